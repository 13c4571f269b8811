#include "master_watch.h"

#include <pthread.h>
#include <ros/console.h>
#include <ros/master.h>
#include <ros/this_node.h>
#include <ros/xmlrpc_manager.h>

#include <utility>

namespace stepdriver::ros_node {
namespace {

constexpr std::chrono::milliseconds kAskPeriod{1000};

}  // namespace

MasterWatch::MasterWatch(std::string service, Events events)
    : service_(std::move(service)),
      events_(std::move(events)),
      master_(ros::master::getHost(), ros::master::getPort(), kMasterPatience) {}

MasterWatch::~MasterWatch() { stop(); }

void MasterWatch::start() {
  look();
  thread_ = std::thread([this] {
    pthread_setname_np(pthread_self(), "master");
    watch();
  });
}

void MasterWatch::stop() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    ending_ = true;
  }
  end_.notify_all();
  if (thread_.joinable()) thread_.join();
}

MasterWatch::Reading MasterWatch::reading() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  Reading reading{ros::master::getURI(), 0.0, restarts_};
  if (lost_) reading.silent = std::chrono::duration<double>(Clock::now() - *lost_).count();
  return reading;
}

void MasterWatch::watch() {
  std::unique_lock<std::mutex> lock(mutex_);
  while (!end_.wait_for(lock, kAskPeriod, [this] { return ending_; })) {
    lock.unlock();
    look();
    lock.lock();
  }
}

void MasterWatch::look() {
  const std::string& name = ros::this_node::getName();
  // A master may know a node without knowing all that it has registered. This must not be missing.
  const auto found = master_.call("lookupService", name, service_);
  if (!found) {
    lose();
    return;
  }
  const bool known = found->code == 1;
  if (known && !registrations_) registrations_ = Registrations::read(master_, name);
  if (!known || !registered_) {
    const auto other = hasAnotherNode();
    if (!other) return lose();
    if (!*other) registerAgain();
  }
  find();
}

// A master forgets the older one of two nodes of the same name, and only then asks it to end.
std::optional<bool> MasterWatch::hasAnotherNode() {
  const std::string& name = ros::this_node::getName();
  auto found = master_.call("lookupNode", name, name);
  if (!found || found->value.getType() != XmlRpc::XmlRpcValue::TypeString) return std::nullopt;
  return found->code == 1 &&
         static_cast<std::string>(found->value) != ros::XMLRPCManager::instance()->getServerURI();
}

void MasterWatch::lose() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (lost_) return;
    lost_ = Clock::now();
  }
  events_.lost();
}

void MasterWatch::find() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (!lost_) return;
    lost_.reset();
  }
  events_.found();
}

void MasterWatch::registerAgain() {
  if (!registrations_) {
    ROS_ERROR_THROTTLE_NAMED(60.0, "master",
                             "The ROS master was restarted before this node could ask it what "
                             "is registered: start the node again");
    return;
  }
  registered_ = events_.forgotten() && registrations_->registerAgain(
                                           master_, ros::XMLRPCManager::instance()->getServerURI());
  if (!registered_) return;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    ++restarts_;
  }
  events_.registered(*registrations_);
}

MasterWatch::Events loggedEvents(const std::function<void()>& lost,
                                 const std::function<bool()>& forgotten) {
  MasterWatch::Events events;
  events.lost = [lost] {
    ROS_ERROR_NAMED("master",
                    "The ROS master at %s doesn't answer. Clients that are connected are served; "
                    "new ones can't find this node until the master is back",
                    ros::master::getURI().c_str());
    lost();
  };
  events.found = [] { ROS_INFO_NAMED("master", "The ROS master answers again"); };
  events.forgotten = forgotten;
  events.registered = [](const Registrations& all) {
    ROS_WARN_NAMED("master",
                   "The ROS master was restarted: %zu topics and %zu services are registered "
                   "again. It has forgotten all parameters, also this node's",
                   all.topics(), all.services());
  };
  return events;
}

}  // namespace stepdriver::ros_node
