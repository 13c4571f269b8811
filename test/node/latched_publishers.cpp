#include <gtest/gtest.h>

#include <boost/make_shared.hpp>
#include <map>
#include <optional>
#include <string>

#include "common/latched_messages.h"

// Which messages of publishers that latch are old, with a ROS master of the test's own.

namespace stepdriver::node_test {
namespace {

using ros_node::LatchedMessages;
using ros_node::Publishers;

const std::string kTopic = "/stepdriver/command";
const std::string kOther = "/stepdriver/jog";

/// A master that knows what the test tells it.
class FakeMaster : public ros_node::PublisherDirectory {
 public:
  std::optional<Publishers> publishers() override {
    if (silent) return std::nullopt;
    return topics;
  }
  std::optional<std::string> addressOf(const std::string& node) override {
    if (silent) return std::nullopt;
    const auto found = addresses.find(node);
    return found == addresses.end() ? std::string() : found->second;
  }

  /// A process of that name registers.
  void begin(const std::string& node, const std::string& address,
             const std::string& topic = kTopic) {
    topics[topic].push_back(node);
    addresses[node] = address;
  }
  void restart() {
    topics.clear();
    addresses.clear();
  }

  Publishers topics;
  std::map<std::string, std::string> addresses;
  bool silent = false;
};

LatchedMessages::Connection connect(const std::string& node, const std::string& latching = "1") {
  auto header = boost::make_shared<ros::M_string>();
  (*header)["callerid"] = node;
  if (!latching.empty()) (*header)["latching"] = latching;
  return header;
}

class LatchedPublisher : public testing::Test {
 protected:
  /// The node starts now.
  void start() {
    messages.emplace(master);
    messages->expect(kTopic);
    messages->expect(kOther);
  }
  bool isOld(const LatchedMessages::Connection& connection, const std::string& topic = kTopic) {
    return messages->isOld(topic, connection);
  }

  FakeMaster master;
  std::optional<LatchedMessages> messages;
};

TEST_F(LatchedPublisher, ThatWasThereBeforeTheNodeHasAnOldMessageAndThenNewOnes) {
  master.begin("/panel", "http://a:1/");
  start();
  const auto connection = connect("/panel");
  EXPECT_TRUE(isOld(connection));
  EXPECT_FALSE(isOld(connection));
  EXPECT_FALSE(isOld(connection));
}

TEST_F(LatchedPublisher, ThatCameLaterHasNewMessages) {
  start();
  master.begin("/rostopic_1", "http://a:1/");
  EXPECT_FALSE(isOld(connect("/rostopic_1")));
  master.begin("/rostopic_2", "http://a:2/");
  EXPECT_FALSE(isOld(connect("/rostopic_2")));
}

TEST_F(LatchedPublisher, ThatDoesNotLatchNeverHasAnOldMessage) {
  master.begin("/stream", "http://a:1/");
  start();
  EXPECT_FALSE(isOld(connect("/stream", "0")));
  EXPECT_FALSE(isOld(connect("/stream", "")));
  EXPECT_FALSE(isOld(nullptr)) << "within a process there is no connection";
}

TEST_F(LatchedPublisher, ThatConnectsAgainSendsItsOldMessageAgain) {
  start();
  master.begin("/panel", "http://a:1/");
  EXPECT_FALSE(isOld(connect("/panel")));
  for (int i = 0; i < 3; ++i) {
    const auto again = connect("/panel");
    EXPECT_TRUE(isOld(again));
    EXPECT_FALSE(isOld(again));
  }
}

TEST_F(LatchedPublisher, ThatIsStartedAgainUnderItsNameIsANewOne) {
  master.begin("/go_home", "http://a:1/");
  start();
  EXPECT_TRUE(isOld(connect("/go_home")));
  master.begin("/go_home", "http://a:2/");
  EXPECT_FALSE(isOld(connect("/go_home")));
  EXPECT_TRUE(isOld(connect("/go_home"))) << "and connects again";
  master.begin("/go_home", "http://a:3/");
  EXPECT_FALSE(isOld(connect("/go_home")));
}

TEST_F(LatchedPublisher, ThatEndsAtOnceIsANewOneEachTime) {
  start();
  EXPECT_FALSE(isOld(connect("/go_home"))) << "the master has forgotten it already";
  master.begin("/go_home", "http://a:2/");
  EXPECT_FALSE(isOld(connect("/go_home")));
}

TEST_F(LatchedPublisher, ThatConnectsAgainWithoutAMasterSendsItsOldMessageAgain) {
  start();
  master.begin("/panel", "http://a:1/");
  EXPECT_FALSE(isOld(connect("/panel")));
  master.silent = true;
  EXPECT_TRUE(isOld(connect("/panel")));
  master.silent = false;
  master.restart();
  EXPECT_TRUE(isOld(connect("/panel"))) << "the new master doesn't know it";
  master.begin("/panel", "http://a:1/");
  EXPECT_TRUE(isOld(connect("/panel")));
}

TEST_F(LatchedPublisher, WhoseAddressWasNeverKnownIsNotTakenForAnother) {
  start();
  master.silent = true;
  EXPECT_FALSE(isOld(connect("/panel"))) << "it has come later";
  master.silent = false;
  master.begin("/panel", "http://a:1/");
  EXPECT_TRUE(isOld(connect("/panel")));
}

TEST_F(LatchedPublisher, ThatRegisteredWithARestartedMasterBeforeTheNodeHasAnOldMessage) {
  start();
  master.restart();
  master.begin("/panel", "http://a:7/");
  ASSERT_TRUE(messages->lookAgain());
  EXPECT_TRUE(isOld(connect("/panel")));
  master.begin("/rostopic_1", "http://a:8/");
  EXPECT_FALSE(isOld(connect("/rostopic_1")));
  master.silent = true;
  EXPECT_FALSE(messages->lookAgain());
}

TEST_F(LatchedPublisher, ThatKeepsItsConnectionWhileTheMasterIsRestartedHasNewMessages) {
  start();
  master.begin("/panel", "http://a:1/");
  const auto connection = connect("/panel");
  EXPECT_FALSE(isOld(connection));
  ASSERT_TRUE(messages->lookAgain());
  EXPECT_FALSE(isOld(connection));
}

TEST_F(LatchedPublisher, IsJudgedForEachTopicAndForItself) {
  master.begin("/panel", "http://a:1/");
  master.begin("/desk", "http://a:2/", kOther);
  start();
  EXPECT_FALSE(isOld(connect("/panel"), kOther));
  EXPECT_FALSE(isOld(connect("/desk"), kTopic));
  EXPECT_TRUE(isOld(connect("/panel"), kTopic));
  EXPECT_TRUE(isOld(connect("/desk"), kOther));
  const auto panel = connect("/panel");
  const auto desk = connect("/desk");
  EXPECT_TRUE(isOld(panel));
  EXPECT_TRUE(isOld(desk));
  EXPECT_FALSE(isOld(panel));
  EXPECT_FALSE(isOld(desk));
}

TEST_F(LatchedPublisher, IsRememberedAmongAThousandOthers) {
  start();
  master.begin("/panel", "http://a:1/");
  EXPECT_FALSE(isOld(connect("/panel")));
  for (int i = 0; i < 999; ++i) EXPECT_FALSE(isOld(connect("/rostopic_" + std::to_string(i))));
  EXPECT_TRUE(isOld(connect("/panel")));
}

}  // namespace
}  // namespace stepdriver::node_test
