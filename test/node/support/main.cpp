#include <gtest/gtest.h>
#include <ros/init.h>
#include <ros/node_handle.h>
#include <ros/spinner.h>

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "node_test", ros::init_options::AnonymousName);
  const ros::NodeHandle node;
  ros::AsyncSpinner spinner(2);
  spinner.start();
  return RUN_ALL_TESTS();
}
