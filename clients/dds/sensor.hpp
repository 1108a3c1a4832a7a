#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>

#include "clients/common/daemon_option.hpp"
#include "clients/common/link.hpp"
#include "clients/dds/graph.hpp"
#include "clients/dds/messages.hpp"
#include "daemon/serve/token_bucket.hpp"
#include "proto/dtact.pb.h"

namespace dtact::dds {

/// What all sensors share.
struct Settings {
  std::uint32_t decimation = 4;  ///< Of the map: 1, 2 or 4.
  bool all_points = false;       ///< Also those outside the contact.
  double hz = 0;                 ///< Frames a second, at most; 0: all.
  bool commands = false;         ///< Take light, re-zero and resolution from the graph.
};

/// One daemon on the ROS 2 graph. Requests only parts that somebody subscribes to. The constructor
/// and the public functions belong to one thread; messages are written on the connections' threads.
class Sensor {
 public:
  using Log = std::function<void(const std::string&)>;

  /// `perceive`: the dtact-perceive of this sensor, for what the object is and where. `graph`
  /// must outlive this.
  Sensor(Graph& graph, const cli::NamedDaemon& daemon,
         const std::optional<client::Options>& perceive, const Settings& settings, Log log);

  [[nodiscard]] const std::string& name() const noexcept { return name_; }
  /// Reaches the daemon so from the next connection on.
  void use(client::Options options) { daemon_.link->use(std::move(options)); }
  /// Requests from the daemon what is subscribed to now.
  void follow_subscribers();
  /// Measures the clocks and, with `diagnostics` or where the temperature is subscribed to, asks
  /// for the daemon's status.
  void each_second(bool diagnostics);
  /// Passes the commands that have come on.
  void take_commands();
  /// What the last status said, or why there is none.
  [[nodiscard]] Diagnosis diagnosis() const;

 private:
  enum Topic : std::uint8_t {
    kImage,
    kCameraInfo,
    kJpeg,
    kPoints,
    kContact,
    kWrench,
    kClock,
    kTemperature,
    kPose,
    kTracking,
    kRecognition,
    kTopics
  };
  enum Command : std::uint8_t { kLed, kRezero, kResolution, kCommands };
  struct Waiting {
    Command command;
    std::uint64_t id = 0;  ///< As the one who asked counts.
  };
  struct Ping {
    std::int64_t sent_ns = 0;      ///< ROS time …
    std::int64_t sent_steady = 0;  ///< … and CLOCK_MONOTONIC here.
  };

  /// A connection with what it is subscribed to.
  struct Upstream {
    mutable std::mutex mutex;
    bool up = false;
    bool local = false;
    std::string reason = "it has not answered yet";
    v1::Subscribe wanted;
    std::unique_ptr<cli::Link> link;
  };

  [[nodiscard]] bool wanted(Topic topic) const { return has_subscriber(writers_[topic]); }
  void connect(Upstream& upstream, const client::Options& options, const std::string& called,
               bool is_daemon);
  void want(Upstream& upstream, const v1::Subscribe& subscription);
  /// Under the mutex.
  static void subscribe(Upstream& upstream);
  void ping();
  void on_message(const std::string& bytes);
  void on_reply(const v1::Reply& reply);
  void on_pong(std::uint64_t id, const v1::Pong& pong);
  void on_status(const v1::Status& status);
  void on_frame(const v1::Frame& frame);
  void on_object(const v1::Frame& frame);
  void publish_points(const v1::Frame& frame, const Header& header);
  [[nodiscard]] Header header_of(const v1::Frame& frame, std::string frame_id) const;
  void pass_on(Command command, std::uint64_t id, v1::ClientMessage message);
  void fail_waiting(const std::string& reason);

  const std::string name_;
  const Settings settings_;
  const Log log_;
  std::array<dds_entity_t, kTopics> writers_{};
  std::array<dds_entity_t, kCommands> commands_{};  ///< Readers, …
  std::array<dds_entity_t, kCommands> results_{};   ///< … and writers of their answers.

  mutable std::mutex mutex_;  ///< Guards the members from here on.
  std::optional<ClockMapping> mapping_;
  std::map<std::uint64_t, Ping> pings_;  ///< Unanswered ones, by the id on the wire.
  v1::TimestampMeaning meaning_ = v1::TIMESTAMP_UNSPECIFIED;
  std::map<std::uint64_t, Waiting> waiting_;  ///< By the id on the wire.
  std::uint64_t next_id_;
  Diagnosis diagnosis_;
  std::int64_t diagnosed_steady_ = 0;  ///< CLOCK_MONOTONIC of the last status; 0: none.
  std::int64_t asked_steady_ = 0;  ///< CLOCK_MONOTONIC since when it is asked for; 0: it is not.

  net::TokenBucket budget_{20, 20};  ///< Commands a second.
  PointWriter points_;               ///< Of the daemon's thread, like the next.
  bool points_shown_ = false;        ///< The last points were some.
  Upstream daemon_;                  ///< Last: their threads use the others.
  Upstream perceive_;
};

/// Nanoseconds of the ROS clock, which is the system's.
[[nodiscard]] std::int64_t ros_now();

}  // namespace dtact::dds
