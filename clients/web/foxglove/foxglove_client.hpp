#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "clients/web/foxglove/protocol.hpp"
#include "clients/web/foxglove/sensor_topics.hpp"
#include "clients/web/web_socket.hpp"
#include "daemon/serve/token_bucket.hpp"
#include "daemon/serve/tokens.hpp"

namespace dtact::web::foxglove {

/// A sensor, and what stands before its topics.
struct Mount {
  std::shared_ptr<SensorTopics> sensor;
  std::string prefix;    ///< "" or "/left"
  Topics reported = {};  ///< The client knows these channels.
};

/// One client of the Foxglove protocol. Runs on the gateway's `io` thread.
///
/// Overflow. Of each channel the newest message waits, in place of one before it. Answers and
/// notices are never dropped: a client with more than kMaxControl of them unread is disconnected.
class FoxgloveClient : public SensorTopics::Listener,
                       public std::enable_shared_from_this<FoxgloveClient> {
 public:
  static constexpr std::size_t kMaxControl = 256;
  static constexpr std::size_t kMaxSubscriptions = 256;
  static constexpr double kMaxRequestsPerS = 100;

  /// `ended` is called once, with the reason; nothing more comes of this client then.
  /// `identity`: what the daemon's log calls it. `program`: the server's name that the client
  /// receives.
  FoxgloveClient(std::shared_ptr<WebSocket> socket, std::vector<Mount> mounts,
                 net::Tokens::Grant grant, std::string identity, std::string program,
                 std::function<void(const std::string&)> ended);

  void start();
  /// Another sensor, after start().
  void add(Mount place);
  void close(const std::string& reason);
  [[nodiscard]] const net::Tokens::Grant& grant() const noexcept { return grant_; }

  void on_message(const SensorTopics& sensor, Topic topic,
                  const std::shared_ptr<const Message>& message) override;
  void on_state(const SensorTopics& sensor, bool well, const std::string& sentence) override;

 private:
  struct Subscription {
    std::size_t place = 0;
    Topic topic = Topic::frame;
    std::shared_ptr<const Message> waiting;
  };
  struct Control {
    std::string bytes;
    bool text = true;
  };

  void read();
  void take(bool text);
  void introduce(std::size_t first);
  void advertise_channels();
  void subscribe(const SubscriptionRequest& request);
  void update_want();
  void call(const Call& call);
  void send(std::string bytes, bool text = true);
  void write_next();
  void write_message(std::uint32_t subscription, std::shared_ptr<const Message> message);
  void on_written(const boost::system::error_code& error);

  std::shared_ptr<WebSocket> socket_;
  std::vector<Mount> mounts_;
  net::Tokens::Grant grant_;
  std::string identity_;
  std::string program_;
  std::function<void(const std::string&)> ended_;
  net::TokenBucket requests_{kMaxRequestsPerS, kMaxRequestsPerS};
  std::array<char, 4096> input_{};
  std::string received_;
  std::map<std::uint32_t, Subscription> subscriptions_;
  std::uint32_t last_sent_ = 0;  ///< The subscription; the others come first.
  std::deque<Control> control_;
  bool writing_ = false;
  bool closed_ = false;
};

}  // namespace dtact::web::foxglove
