#include "clients/dds/recorder.hpp"

#include <dds/ddsi/ddsi_serdata.h>
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <stdexcept>
#include <string_view>
#include <utility>

#include "clients/dds/sensor.hpp"
#include "clients/dds/types.hpp"
#include "version.hpp"

namespace dtact::dds {
namespace {

using Clock = std::chrono::steady_clock;

/// "sensor_msgs::msg::dds_::Image_" → "sensor_msgs/msg/Image".
std::string ros_name(std::string name) {
  constexpr std::string_view kMiddle = "::msg::dds_::";
  name.replace(name.find(kMiddle), kMiddle.size(), "/msg/");
  name.pop_back();
  return name;
}

/// By which the messages of a writer are known.
dds_instance_handle_t handle_of(dds_entity_t writer) {
  dds_instance_handle_t handle = 0;
  if (dds_get_instance_handle(writer, &handle) != DDS_RETCODE_OK) {
    throw std::runtime_error("DDS: a writer has no handle");
  }
  return handle;
}

/// What a writer offers, as rosbag2 notes it up to version 8 of its metadata: rmw's numbers, in
/// YAML. `ros2 bag play` offers the same; a listener of /tf_static takes nothing that is not
/// latched.
std::string offered(Qos kind) {
  constexpr const char* kNever = "{sec: 9223372036, nsec: 854775807}";
  return fmt::format(
      "- history: 1\n"  // keep last
      "  depth: {}\n"
      "  reliability: 1\n"  // reliable
      "  durability: {}\n"  // 1: transient local, 2: volatile
      "  deadline: {}\n"
      "  lifespan: {}\n"
      "  liveliness: 1\n"  // automatic
      "  liveliness_lease_duration: {}\n"
      "  avoid_ros_namespace_conventions: false\n",
      Graph::depth(kind), kind == Qos::latched ? 1 : 2, kNever, kNever, kNever);
}

}  // namespace

Recorder::Recorder(Graph& graph, const std::string& file, bool replace)
    : sink_(file, replace),
      writer_(sink_, {.library = "dtact-dds " DTACT_VERSION, .profile = "ros2"}),
      waitset_(graph.make_waitset()) {
  // Without metadata of its own in it, rosbag2 takes the file for one of version 8.
  writer_.add(mcap::Metadata{"rosbag2", {{"serialized_metadata", ""}}});
  std::map<std::string, std::uint16_t> schemas;
  for (const Graph::Published& one : graph.published()) {
    if (one.topic.ends_with("/result")) continue;
    const auto* type = std::ranges::find_if(kTypes, [&](const Type& known) {
      return std::string_view(one.type->m_typename) == known.name;
    });
    auto& schema = schemas[type->name];
    if (schema == 0) {
      schema = writer_.add_schema(ros_name(type->name), "ros2msg", type->definition);
    }
    const dds_entity_t reader = graph.subscribe(one, waitset_);
    channels_[reader] = {
        writer_.add_channel(
            schema, one.topic, "cdr",
            {{"offered_qos_profiles", offered(one.qos)}, {"topic_type_hash", type->hash}}),
        one.topic != "/tf_static" && one.topic != "/diagnostics", handle_of(one.writer)};
  }
  thread_ = std::thread([this] { run(); });
}

Recorder::~Recorder() {
  ending_ = true;
  if (thread_.joinable()) thread_.join();
  for (const auto& [reader, _] : channels_) dds_delete(reader);
}

std::uint64_t Recorder::finish() {
  ending_ = true;
  thread_.join();
  for (const auto& [reader, _] : channels_) {
    dds_sample_rejected_status_t status{};
    if (dds_get_sample_rejected_status(reader, &status) == DDS_RETCODE_OK) {
      lost_ += status.total_count;
    }
  }
  try {
    writer_.finish();
  } catch (...) {
    if (!failure_) throw;  // else the first one says more
  }
  if (failure_) std::rethrow_exception(failure_);
  if (!named_) throw std::runtime_error("no message of a sensor came: dtactctl status says why");
  return messages_;
}

void Recorder::run() {
  try {
    auto flushed = Clock::now();
    for (bool last = false; !last;) {
      last = ending_;  // what has come while the disk was busy is still taken
      (void)dds_waitset_wait(waitset_, nullptr, 0, DDS_MSECS(100));
      for (const auto& [reader, channel] : channels_) take(reader, channel);
      if (Clock::now() - flushed < std::chrono::seconds(1)) continue;
      flushed = Clock::now();
      writer_.flush();
    }
  } catch (...) {
    failure_ = std::current_exception();
    failed_ = true;
  }
}

void Recorder::take(dds_entity_t reader, const Channel& channel) {
  // Not without end: on a slow disk more may come than are written.
  for (std::int32_t i = 0; i < Graph::kMaxUnread; ++i) {
    ddsi_serdata* message = nullptr;
    dds_sample_info_t info{};
    if (dds_takecdr(reader, &message, 1, &info, DDS_ANY_STATE) <= 0) return;
    if (info.valid_data) {
      buffer_.resize(ddsi_serdata_size(message));
      ddsi_serdata_to_ser(message, 0, buffer_.size(), buffer_.data());
    }
    ddsi_serdata_unref(message);
    if (!info.valid_data || info.publication_handle != channel.writer) continue;
    writer_.add(mcap::Message{channel.id, static_cast<std::uint32_t>(messages_++),
                              static_cast<std::uint64_t>(ros_now()),
                              static_cast<std::uint64_t>(info.source_timestamp), buffer_});
    if (channel.of_sensor && !std::exchange(named_, true)) sink_.give_name();
  }
}

}  // namespace dtact::dds
