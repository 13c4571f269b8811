#include <gtest/gtest.h>
#include <ros/init.h>
#include <ros/node_handle.h>
#include <ros/spinner.h>

#include <iostream>
#include <string>
#include <string_view>

// Runs the tests of one file: `node_tests jog_test` those of jog_test.cpp.

namespace {

// A filter that chooses the tests of that file; empty if it has none.
std::string testsOf(const std::string& file) {
  const std::string end = "/" + file + ".cpp";
  const testing::UnitTest& all = *testing::UnitTest::GetInstance();
  std::string filter;
  for (int i = 0; i < all.total_test_suite_count(); ++i) {
    const testing::TestSuite& suite = *all.GetTestSuite(i);
    for (int j = 0; j < suite.total_test_count(); ++j) {
      const testing::TestInfo& test = *suite.GetTestInfo(j);
      const std::string_view place = test.file();
      if (place.size() < end.size() || place.substr(place.size() - end.size()) != end) continue;
      filter += std::string(suite.name()) + "." + test.name() + ":";
    }
  }
  return filter;
}

}  // namespace

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "node_test", ros::init_options::AnonymousName);
  const std::string filter = argc == 2 ? testsOf(argv[1]) : "";
  if (filter.empty()) {
    std::cerr << "usage: node_tests FILE, of test/node, without its .cpp; there are no tests of "
              << (argc > 1 ? argv[1] : "no file") << "\n";
    return 2;
  }
  if (testing::GTEST_FLAG(filter) == "*") testing::GTEST_FLAG(filter) = filter;
  const ros::NodeHandle node;
  ros::AsyncSpinner spinner(2);
  spinner.start();
  return RUN_ALL_TESTS();
}
