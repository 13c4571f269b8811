#include "trigger_session.h"

#include <fmt/format.h>
#include <ros/serialization.h>
#include <ros/service_traits.h>
#include <ros/this_node.h>

#include <optional>
#include <utility>

#include "tcpros.h"

namespace stepdriver::ros_node {
namespace {

using Service = std_srvs::Trigger;

// roscpp sends some 200 bytes; a client may add fields of its own.
constexpr std::size_t kMostHeaderBytes = 16384;

std::string fieldOf(const ConnectionHeader& header, const std::string& name) {
  const auto found = header.find(name);
  return found == header.end() ? "" : found->second;
}

ConnectionHeader introduction() {
  return {{"callerid", ros::this_node::getName()},
          {"md5sum", ros::service_traits::md5sum<Service>()},
          {"type", ros::service_traits::datatype<Service>()},
          {"request_type", ros::message_traits::datatype<Service::Request>()},
          {"response_type", ros::message_traits::datatype<Service::Response>()}};
}

}  // namespace

std::size_t TriggerSession::wanted() const {
  if (!output().empty()) return 0;
  switch (stage_) {
    case Stage::kHeaderLength:
    case Stage::kRequest:
      return kLengthBytes - input_.size();
    case Stage::kHeader:
      return header_length_ - input_.size();
    case Stage::kOver:
    case Stage::kBroken:
      break;
  }
  return 0;
}

void TriggerSession::receive(std::string_view bytes) {
  input_ += bytes;
  if (wanted() > 0) return;
  const std::string message = std::exchange(input_, {});
  switch (stage_) {
    case Stage::kHeaderLength:
      header_length_ = readLength(message);
      stage_ = header_length_ > 0 && header_length_ <= kMostHeaderBytes ? Stage::kHeader
                                                                        : Stage::kBroken;
      break;
    case Stage::kHeader:
      answerHeader(message);
      break;
    case Stage::kRequest:
      // A request of this type has no fields.
      if (readLength(message) == 0) {
        serve();
      } else {
        stage_ = Stage::kBroken;
      }
      break;
    case Stage::kOver:
    case Stage::kBroken:
      break;
  }
}

bool TriggerSession::isIdle() const {
  return stage_ == Stage::kRequest && persistent_ && input_.empty() && output().empty();
}

void TriggerSession::answerHeader(std::string_view bytes) {
  const std::optional<ConnectionHeader> header = readHeader(bytes);
  if (!header) {
    stage_ = Stage::kBroken;
    return;
  }
  for (const char* field : {"callerid", "service", "md5sum"}) {
    if (header->count(field) == 0) {
      return refuse(fmt::format("the header has no field \"{}\"", field));
    }
  }
  const std::string name = fieldOf(*header, "service");
  service_ = services_.find(name);
  if (service_ == services_.end()) {
    return refuse(fmt::format("there is no service {} here", name));
  }
  const std::string md5sum = fieldOf(*header, "md5sum");
  const ConnectionHeader ours = introduction();
  if (md5sum != "*" && md5sum != ours.at("md5sum")) {
    return refuse(fmt::format("{} is a {} with the md5sum {}, and not {}", name, ours.at("type"),
                              ours.at("md5sum"), md5sum));
  }
  const std::string persistent = fieldOf(*header, "persistent");
  persistent_ = persistent == "1" || persistent == "true";
  say(headerBytes(ours));
  stage_ = Stage::kRequest;
}

void TriggerSession::refuse(const std::string& why) {
  say(headerBytes({{"error", why}}));
  stage_ = Stage::kOver;
}

void TriggerSession::serve() {
  Service::Request request;
  Service::Response response;
  const bool ok = service_->second(request, response);
  const ros::SerializedMessage answer = ros::serialization::serializeServiceResponse(ok, response);
  say(std::string(answer.buf.get(), answer.buf.get() + answer.num_bytes));
  if (!persistent_) stage_ = Stage::kOver;
}

void TriggerSession::say(std::string bytes) {
  output_ = std::move(bytes);
  sent_ = 0;
}

}  // namespace stepdriver::ros_node
