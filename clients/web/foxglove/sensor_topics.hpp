#pragma once

#include <array>
#include <boost/asio/steady_timer.hpp>
#include <map>
#include <memory>
#include <optional>
#include <string>

#include "clients/web/foxglove/topics.hpp"
#include "clients/web/source.hpp"

namespace dtact::web::foxglove {

/// One daemon's channels. Makes each message once for all subscribers, and requests only subscribed
/// parts from the daemon. Runs on the thread of the gateway's `io`.
class SensorTopics : public std::enable_shared_from_this<SensorTopics> {
 public:
  class Listener {
   public:
    Listener() = default;
    Listener(const Listener&) = delete;
    Listener& operator=(const Listener&) = delete;
    virtual ~Listener() = default;

    virtual void on_message(const SensorTopics& sensor, Topic topic,
                            const std::shared_ptr<const Message>& message) = 0;
    /// A sentence on why nothing comes; empty when it does again.
    virtual void on_state(const SensorTopics& sensor, bool well, const std::string& sentence) = 0;
  };

  explicit SensorTopics(std::shared_ptr<Source> source);

  void start();
  void stop();
  /// Sets what a listener wants from now on. From its first call it receives the daemon's state,
  /// also when it wants nothing.
  void want(Listener& listener, Topics wanted);
  void forget(Listener& listener);
  [[nodiscard]] Source& source() const noexcept { return *source_; }
  /// The present light, for new subscribers; null while unknown.
  [[nodiscard]] const std::shared_ptr<const Message>& light() const noexcept { return light_; }

 private:
  void on_changed();
  void on_event(const v1::Event& event);
  void on_frame(const RelayedFrame& frame);
  void clear_points(const v1::Frame& frame);
  void publish(Topic topic, const std::shared_ptr<const Message>& message);
  void publish_state(bool well, const std::string& sentence);
  void update();
  void ask_again_later();
  [[nodiscard]] Topics wanted() const;

  std::shared_ptr<Source> source_;
  std::map<Listener*, Topics> listeners_;
  /// The Subscribe that the daemon knows, serialized; none: not known.
  std::optional<std::string> asked_ = "";
  bool refused_ = false;  ///< The last one was.
  boost::asio::steady_timer retry_;
  std::shared_ptr<const Message> light_;
  bool points_shown_ = false;  ///< The last points were some.
};

}  // namespace dtact::web::foxglove
