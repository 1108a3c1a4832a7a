#include "clients/dds/sensor.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <iterator>
#include <stdexcept>
#include <string_view>
#include <utility>

#include "clients/cpp/names.hpp"
#include "clients/dds/ros2.h"

namespace dtact::dds {
namespace {

// Ids on the wire; Hello's is 1.
constexpr std::uint64_t kSubscribeId = 2;
constexpr std::uint64_t kStatusId = 4;
constexpr std::uint64_t kFirstFreeId = 16;  // of commands and pings

constexpr std::size_t kMaxWaiting = 32;
constexpr std::size_t kMaxPings = 16;
/// Bytes of a name in a command; the names that the daemon knows are shorter.
constexpr std::size_t kMaxWord = 64;
/// Clocks of computers drift apart by less, a share of the time.
constexpr double kMaxDrift = 100e-6;
constexpr std::int64_t kStaleNs = 3'000'000'000;

template <typename Clock>
std::int64_t now_of() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(Clock::now().time_since_epoch())
      .count();
}
std::int64_t steady_now() { return now_of<std::chrono::steady_clock>(); }

/// The messages that a reader has, until none are left.
template <typename Message, typename Take>
void take_all(dds_entity_t reader, Take take) {
  for (;;) {
    void* message = nullptr;
    dds_sample_info_t info{};
    if (dds_take(reader, &message, &info, 1, 1) <= 0) return;
    if (info.valid_data) take(*static_cast<const Message*>(message));
    (void)dds_return_loan(reader, &message, 1);
  }
}

/// A name from the graph as the wire takes it. There it may have any bytes, and the daemon ends the
/// connection for a `string` that is not UTF-8; it refuses a wrong name by its own sentence.
std::string word_of(const char* value) {
  std::string word(std::string_view(value == nullptr ? "" : value).substr(0, kMaxWord));
  std::ranges::replace_if(word, [](unsigned char c) { return c < 0x20 || c > 0x7e; }, '?');
  return word;
}

}  // namespace

std::int64_t ros_now() { return now_of<std::chrono::system_clock>(); }

Sensor::Sensor(Graph& graph, const cli::NamedDaemon& daemon,
               const std::optional<client::Options>& perceive, const Settings& settings, Log log)
    : name_(daemon.name), settings_(settings), log_(std::move(log)), next_id_(kFirstFreeId) {
  struct Known {
    const char* name;
    const dds_topic_descriptor_t* type;
    Qos qos = Qos::sensor;
  };
  static const std::array<Known, kTopics> kKnown{{
      {"indentation/image", &sensor_msgs_msg_dds__Image__desc},
      {"indentation/camera_info", &sensor_msgs_msg_dds__CameraInfo__desc},
      {"image_raw/compressed", &sensor_msgs_msg_dds__CompressedImage__desc},
      {"points", &sensor_msgs_msg_dds__PointCloud2__desc},
      {"contact", &dtact_msgs_msg_dds__Contact__desc},
      {"wrench", &geometry_msgs_msg_dds__WrenchStamped__desc},
      {"clock_mapping", &dtact_msgs_msg_dds__ClockMapping__desc, Qos::latched},
      {"temperature", &sensor_msgs_msg_dds__Temperature__desc},
      {"object_pose", &geometry_msgs_msg_dds__PoseStamped__desc},
      {"object_pose/tracking", &dtact_msgs_msg_dds__ObjectTracking__desc},
      {"recognition", &dtact_msgs_msg_dds__Recognition__desc},
  }};
  const std::string space = "/" + name_;
  const std::size_t node = graph.add_node(space, "dtact");
  const std::size_t topics = perceive ? kTopics : kPose;
  for (std::size_t i = 0; i < topics; ++i) {
    writers_[i] = graph.add_writer(node, fmt::format("{}/{}", space, kKnown[i].name),
                                   *kKnown[i].type, kKnown[i].qos);
  }
  if (settings.commands) {
    static const std::array<Known, kCommands> kKnownCommands{{
        {"led", &dtact_msgs_msg_dds__Led__desc},
        {"rezero", &dtact_msgs_msg_dds__Rezero__desc},
        {"resolution", &dtact_msgs_msg_dds__Resolution__desc},
    }};
    for (std::size_t i = 0; i < kCommands; ++i) {
      const std::string topic = fmt::format("{}/{}", space, kKnownCommands[i].name);
      results_[i] =
          graph.add_writer(node, topic + "/result", dtact_msgs_msg_dds__Result__desc, Qos::command);
      commands_[i] = graph.add_reader(node, topic, *kKnownCommands[i].type);
    }
  }
  connect(daemon_, daemon.options, name_, true);
  if (perceive) connect(perceive_, *perceive, name_ + "'s dtact-perceive", false);
}

void Sensor::connect(Upstream& upstream, const client::Options& options, const std::string& called,
                     bool is_daemon) {
  cli::Link::Handlers handlers;
  handlers.up = [this, &upstream, called, is_daemon](const v1::HelloReply& hello, bool local) {
    if (is_daemon) {
      const std::lock_guard lock(mutex_);
      mapping_.reset();
      pings_.clear();
      asked_steady_ = diagnosed_steady_ = 0;
      diagnosis_.hardware = hello.serial().empty() ? hello.name() : hello.serial();
    }
    {
      const std::lock_guard lock(upstream.mutex);
      upstream.up = true;
      upstream.local = local;
      upstream.reason.clear();
    }
    // Before the first frame, so that its stamp is known.
    if (is_daemon) ping();
    const std::lock_guard lock(upstream.mutex);
    subscribe(upstream);
    log_(fmt::format("{} is there: {}", called, hello.program()));
  };
  handlers.down = [this, &upstream, called, is_daemon](const std::string& reason) {
    {
      const std::lock_guard lock(upstream.mutex);
      upstream.up = false;
      upstream.reason = reason;
    }
    if (is_daemon) fail_waiting(reason);
    log_(fmt::format("{} is away: {}", called, reason));
  };
  handlers.message = [this, called, is_daemon](const std::string& bytes) {
    v1::ServerMessage message;
    if (!message.ParseFromString(bytes)) {
      throw std::runtime_error(name_ + " sends what is no message of the wire");
    }
    if (message.has_reply()) {
      if (is_daemon) {
        on_reply(message.reply());
      } else if (message.reply().has_error()) {
        log_(fmt::format("{}: {}", called, message.reply().error().message()));
      }
    } else if (message.has_frame()) {
      is_daemon ? on_frame(message.frame()) : on_object(message.frame());
    }
  };
  // Its thread waits for the mutex until the link is there.
  const std::lock_guard lock(upstream.mutex);
  upstream.link = std::make_unique<cli::Link>(options, std::move(handlers));
}

void Sensor::follow_subscribers() {
  v1::Subscribe request;
  request.set_events(false);
  const bool map = wanted(kImage) || wanted(kCameraInfo);
  if (map || wanted(kPoints)) {
    request.set_depth(v1::DEPTH_PREDICT_ZSTD);
    request.set_decimation(settings_.decimation);
    request.set_depth_hz(settings_.hz);
    if (!map && !settings_.all_points) request.set_contact_box(true);
  }
  if (wanted(kJpeg)) {
    request.set_jpeg(true);
    request.set_jpeg_hz(settings_.hz);
  }
  // Points also with the frame in which the contact has ended.
  if (wanted(kContact) || wanted(kWrench) || wanted(kPoints)) {
    request.set_summary(true);
    request.set_summary_hz(settings_.hz);
  }
  want(daemon_, request);
  if (perceive_.link == nullptr) return;
  v1::Subscribe object;
  object.set_events(false);
  object.set_pose(wanted(kPose) || wanted(kTracking));
  object.set_pose_hz(settings_.hz);
  object.set_recognition(wanted(kRecognition));
  object.set_recognition_hz(settings_.hz);
  want(perceive_, object);
}

void Sensor::want(Upstream& upstream, const v1::Subscribe& subscription) {
  const std::lock_guard lock(upstream.mutex);
  if (upstream.wanted.SerializeAsString() == subscription.SerializeAsString()) return;
  upstream.wanted = subscription;
  subscribe(upstream);
}

void Sensor::subscribe(Upstream& upstream) {
  if (!upstream.up) return;
  v1::ClientMessage message;
  message.set_id(kSubscribeId);
  *message.mutable_subscribe() = upstream.wanted;
  // Raw values cost least where they need not travel.
  if (upstream.local && upstream.wanted.depth() != v1::DEPTH_NONE) {
    message.mutable_subscribe()->set_depth(v1::DEPTH_INT16);
  }
  upstream.link->send(message.SerializeAsString());
}

void Sensor::each_second(bool diagnostics) {
  {
    const std::lock_guard lock(daemon_.mutex);
    if (!daemon_.up) return;
  }
  ping();
  const bool asks = diagnostics || wanted(kTemperature);
  {
    const std::lock_guard lock(mutex_);
    if (!asks) asked_steady_ = 0;
    if (asks && asked_steady_ == 0) asked_steady_ = steady_now();
  }
  if (asks) {
    v1::ClientMessage message;
    message.set_id(kStatusId);
    message.mutable_get_status();
    daemon_.link->send(message.SerializeAsString());
  }
  const std::lock_guard lock(mutex_);
  if (mapping_) {
    write_clock(writers_[kClock], {ros_now(), surface_frame(name_)}, *mapping_, meaning_);
  }
}

void Sensor::ping() {
  v1::ClientMessage message;
  message.mutable_ping();
  {
    const std::lock_guard lock(mutex_);
    message.set_id(next_id_);
    pings_[next_id_++] = {ros_now(), steady_now()};
    if (pings_.size() > kMaxPings) pings_.erase(pings_.begin());
  }
  const std::lock_guard lock(daemon_.mutex);
  daemon_.link->send(message.SerializeAsString());
}

void Sensor::on_reply(const v1::Reply& reply) {
  if (reply.has_pong()) return on_pong(reply.id(), reply.pong());
  if (reply.has_status()) return on_status(reply.status());
  const std::string error = reply.has_error() ? reply.error().message() : "";
  Waiting waiting;
  {
    const std::lock_guard lock(mutex_);
    const auto found = waiting_.find(reply.id());
    if (found == waiting_.end()) {
      if (!error.empty()) log_(fmt::format("{}: {}", name_, error));
      return;
    }
    waiting = found->second;
    waiting_.erase(found);
  }
  write_result(results_[waiting.command], waiting.id, error);
}

void Sensor::on_pong(std::uint64_t id, const v1::Pong& pong) {
  const std::int64_t steady = steady_now();
  const std::lock_guard lock(mutex_);
  const auto found = pings_.find(id);
  if (found == pings_.end()) return;
  const Ping ping = found->second;
  // Answers come in the order of the requests, so older pings have none any more.
  pings_.erase(pings_.begin(), std::next(found));
  const std::int64_t half = (steady - ping.sent_steady + 1) / 2;
  const std::int64_t middle = ping.sent_ns + half;
  const ClockMapping made{middle, middle - pong.monotonic_ns(), half, pong.wall_ns() - middle};
  if (mapping_) {
    const double age = std::abs(static_cast<double>(middle - mapping_->measured_ns));
    const auto aged = mapping_->error_ns + static_cast<std::int64_t>(kMaxDrift * age);
    // A clock that was set makes the two contradict each other.
    const bool contradicts = std::abs(made.offset_ns - mapping_->offset_ns) > aged + half;
    if (half > aged && !contradicts) return;
  }
  mapping_ = made;
}

void Sensor::on_status(const v1::Status& status) {
  using Level = Diagnosis::Level;
  const std::lock_guard lock(mutex_);
  diagnosed_steady_ = steady_now();
  const bool lost =
      status.state() == v1::STATE_CAMERA_LOST || status.state() == v1::STATE_UNCALIBRATED;
  diagnosis_.level = lost ? Level::error
                     : status.state() != v1::STATE_SERVING || status.health_size() > 0
                         ? Level::warning
                         : Level::ok;
  diagnosis_.message = status.advice().empty() ? client::name_of(status.state()) : status.advice();
  diagnosis_.values = {{"state", client::name_of(status.state())},
                       {"fps", fmt::format("{:.1f}", status.fps())},
                       {"camera", status.camera().state()},
                       {"frames lost", std::to_string(status.camera().lost())},
                       {"version", status.version()}};
  if (status.has_board_celsius()) {
    diagnosis_.values.emplace_back("board temperature (°C)",
                                   fmt::format("{:.1f}", status.board_celsius()));
    write_temperature(writers_[kTemperature], {ros_now(), board_frame(name_)},
                      status.board_celsius());
  }
  const std::vector<std::string> flags = client::names_of(status.health());
  for (std::size_t i = 0; i < flags.size(); ++i) {
    const auto index = static_cast<int>(i);
    diagnosis_.values.emplace_back("health: " + flags[i],
                                   index < status.fixes_size() ? status.fixes(index) : "");
  }
}

Diagnosis Sensor::diagnosis() const {
  std::string reason;
  {
    const std::lock_guard lock(daemon_.mutex);
    reason = daemon_.reason;
  }
  const std::lock_guard lock(mutex_);
  Diagnosis made = diagnosis_;
  made.name = name_ + ": dtactd";
  if (reason.empty() && steady_now() - diagnosed_steady_ > kStaleNs) {
    if (asked_steady_ != 0 && steady_now() - asked_steady_ > kStaleNs) {
      reason = "no status yet";
    } else {  // nobody wanted to know until now
      made.level = Diagnosis::Level::warning;
      made.message = "its status is being asked for";
      made.values.clear();
    }
  }
  if (!reason.empty()) {
    made.level = Diagnosis::Level::error;
    made.message = reason;
    made.values.clear();
  }
  return made;
}

Header Sensor::header_of(const v1::Frame& frame, std::string frame_id) const {
  const std::lock_guard lock(mutex_);
  return {mapping_ ? frame.monotonic_ns() + mapping_->offset_ns : frame.wall_ns(),
          std::move(frame_id)};
}

void Sensor::on_frame(const v1::Frame& frame) {
  {
    const std::lock_guard lock(mutex_);
    meaning_ = frame.meaning();
  }
  const Header header = header_of(frame, surface_frame(name_));
  // What may have to be waited for least goes first.
  if (wanted(kContact)) write_contact(writers_[kContact], header, frame);
  if (wanted(kWrench)) write_wrench(writers_[kWrench], header, frame);
  const v1::DepthMap& map = frame.depth();
  if (frame.has_depth() && map.width() == map.full_width() && map.height() == map.full_height()) {
    if (wanted(kImage)) write_image(writers_[kImage], header, frame, settings_.decimation == 4);
    if (wanted(kCameraInfo)) write_camera_info(writers_[kCameraInfo], header, map);
  }
  if (frame.has_jpeg() && wanted(kJpeg)) {
    write_jpeg(writers_[kJpeg], {header.stamp_ns, camera_frame(name_)}, frame.jpeg());
  }
  if (wanted(kPoints)) publish_points(frame, header);
}

/// The points of a contact that has ended would stay on the screen.
void Sensor::publish_points(const v1::Frame& frame, const Header& header) {
  if (frame.has_depth() && (settings_.all_points || frame.contact().in_contact())) {
    points_.write(writers_[kPoints], header, frame, settings_.all_points);
    points_shown_ = true;
  } else if (points_shown_ && frame.has_contact() && !frame.contact().in_contact()) {
    PointWriter::write_none(writers_[kPoints], header);
    points_shown_ = false;
  }
}

void Sensor::on_object(const v1::Frame& frame) {
  const Header header = header_of(frame, surface_frame(name_));
  if (frame.has_recognition() && wanted(kRecognition)) {
    write_recognition(writers_[kRecognition], header, frame.recognition());
  }
  if (!frame.has_pose()) return;
  if (wanted(kTracking)) write_tracking(writers_[kTracking], header, frame.pose());
  if (wanted(kPose) && frame.pose().valid()) write_pose(writers_[kPose], header, frame);
}

void Sensor::take_commands() {
  if (!settings_.commands) return;
  take_all<dtact_msgs_msg_dds__Led_>(commands_[kLed], [&](const auto& led) {
    v1::ClientMessage message;
    v1::SetLight& light = *message.mutable_set_light();
    if (led.brightness != -1) {
      // What is out of range the daemon refuses by its own sentence.
      light.set_brightness(static_cast<std::uint32_t>(led.brightness));
    }
    if (std::string scheme = word_of(led.scheme); !scheme.empty()) {
      light.set_scheme(std::move(scheme));
    }
    for (std::uint32_t i = 0; i < led.leds._length && i < 256; ++i) {
      const auto level = [](float channel) {
        return channel >= 0 && channel <= 1 ? static_cast<std::uint32_t>(std::lround(255 * channel))
                                            : 256U;
      };
      v1::Rgb& rgb = *light.add_leds();
      rgb.set_r(level(led.leds._buffer[i].r));
      rgb.set_g(level(led.leds._buffer[i].g));
      rgb.set_b(level(led.leds._buffer[i].b));
    }
    pass_on(kLed, led.id, std::move(message));
  });
  take_all<dtact_msgs_msg_dds__Rezero_>(commands_[kRezero], [&](const auto& rezero) {
    v1::ClientMessage message;
    message.mutable_rezero()->set_force(rezero.force);
    pass_on(kRezero, rezero.id, std::move(message));
  });
  take_all<dtact_msgs_msg_dds__Resolution_>(commands_[kResolution], [&](const auto& resolution) {
    v1::ClientMessage message;
    message.mutable_set_reconstruction()->set_resolution(word_of(resolution.resolution));
    pass_on(kResolution, resolution.id, std::move(message));
  });
}

void Sensor::pass_on(Command command, std::uint64_t id, v1::ClientMessage message) {
  std::string error;
  {
    // Held to the end, so that the handler of a connection that is lost meanwhile comes after it
    // and answers this command, too.
    const std::lock_guard upstream(daemon_.mutex);
    const std::lock_guard lock(mutex_);
    if (!daemon_.up) {
      error = daemon_.reason;
    } else if (waiting_.size() >= kMaxWaiting || !budget_.take(1)) {
      error = "too many commands at once: ask again later";
    } else {
      message.set_id(next_id_);
      message.set_on_behalf_of("ROS 2");
      waiting_[next_id_++] = {command, id};
      daemon_.link->send(message.SerializeAsString());
    }
  }
  if (!error.empty()) write_result(results_[command], id, error);
}

void Sensor::fail_waiting(const std::string& reason) {
  std::map<std::uint64_t, Waiting> all;
  {
    const std::lock_guard lock(mutex_);
    all.swap(waiting_);
  }
  for (const auto& [_, one] : all) write_result(results_[one.command], one.id, reason);
}

}  // namespace dtact::dds
