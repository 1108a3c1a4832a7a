#pragma once

#include <boost/asio/io_context.hpp>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "clients/common/link.hpp"
#include "clients/cpp/options.hpp"
#include "clients/web/feed.hpp"
#include "daemon/serve/token_bucket.hpp"

namespace dtact::web {

/// One daemon behind the gateway: requests passed on, events, and streams of frames that are shared
/// by all who ask for the same. On the thread that runs `io`.
class Source : public std::enable_shared_from_this<Source> {
 public:
  /// Different streams of one daemon at one time; each is a client of it. …
  static constexpr std::size_t kMaxFeeds = 8;
  /// … of which those that may only view leave these to others, …
  static constexpr std::size_t kReservedFeeds = 2;
  /// … and one address or token has at most these.
  static constexpr std::size_t kMaxFeedsOfOne = 5;
  /// Requests a second of all viewers together, and as many at once after a rest: fewer than what
  /// the daemon ends a connection for (500), so that one viewer does not cost all of them the
  /// daemon.
  static constexpr double kMaxRequestsPerS = 400;
  /// Of them those that requests which only read leave to commands.
  static constexpr double kReservedRequests = 100;

  using Answered = std::function<void(v1::Reply)>;
  using OnFrame = std::function<void(const RelayedFrame&, std::uint64_t missed)>;

  /// Callbacks for the daemon's connection state.
  struct Follower {
    std::function<void()> changed;  ///< It went away, for another reason, or is there again.
    std::function<void(const v1::ServerMessage&)> event;
  };

  /// `refused`: why the daemon is not to be connected to at all; empty: it is.
  Source(boost::asio::io_context& io, std::string name, client::Options daemon,
         std::string refused = "");

  void start();
  /// Reaches the daemon so from the next connection on.
  void use(client::Options daemon);
  [[nodiscard]] const client::Options& options() const noexcept { return options_; }
  /// No callback is called afterwards.
  void stop();
  [[nodiscard]] boost::asio::io_context& io() const noexcept { return io_; }
  /// One for each `who`, until unfollow().
  void follow(const void* who, Follower follower) { followers_[who] = std::move(follower); }
  void unfollow(const void* who) { followers_.erase(who); }

  [[nodiscard]] const std::string& name() const noexcept { return name_; }
  [[nodiscard]] bool connected() const noexcept { return connected_; }
  /// Why it is away: a sentence. Empty while it is there.
  [[nodiscard]] const std::string& reason() const noexcept { return reason_; }
  /// What the daemon said of itself last; none before it was ever there.
  [[nodiscard]] const std::optional<v1::HelloReply>& daemon() const noexcept { return daemon_; }

  /// Passes a request of the client `identity` on under an id of its own; `answered` is called
  /// once, also with an error when the daemon goes away first.
  void request(v1::ClientMessage message, const std::string& identity, Answered answered);
  /// One who subscribes.
  struct Subscriber {
    const void* who = nullptr;
    std::string owner;  ///< Its address or token, for kMaxFeedsOfOne.
    bool may_control = false;
  };
  /// Puts `subscriber` on the stream of `request` in place of the one it was on, once the daemon
  /// agrees; `answered` is called once, and then `frame` for each frame, `missed` ones having been
  /// lost before it. A request for nothing ends the stream.
  void subscribe(const Subscriber& subscriber, v1::Subscribe request, Answered answered,
                 OnFrame frame);
  /// Ends the stream of `who`, who is not called any more.
  void leave(const void* who);

 private:
  struct Member {
    const void* who = nullptr;
    std::uint64_t serial = 0;  ///< Its subscribe() call.
    Answered answered;         ///< Null once it was called.
    OnFrame frame;
  };
  struct Stream {
    std::uint64_t number = 0;
    std::string key;    ///< The Subscribe, serialized.
    std::string owner;  ///< Who had it opened: Subscriber::owner.
    std::shared_ptr<Feed> feed;
    bool agreed = false;
    std::vector<Member> members;
  };

  void on_up(const v1::HelloReply& daemon);
  void on_down(const std::string& reason);
  void on_message(const v1::ServerMessage& message);
  void on_answered(std::uint64_t stream, const v1::Reply& reply);
  void on_frame(std::uint64_t stream);
  [[nodiscard]] std::shared_ptr<Feed> open(std::uint64_t stream, const v1::Subscribe& request);
  [[nodiscard]] Stream* find(std::uint64_t stream);
  [[nodiscard]] v1::Reply away() const;
  /// Why no stream is opened for it; empty: there is room.
  [[nodiscard]] std::string no_room_for(const Subscriber& subscriber) const;
  /// Answers the clients that wait for a stream; once it flows, ends their other streams.
  void settle(Stream& stream, const v1::Reply& reply);
  void retire_empty();
  void notify_all();

  boost::asio::io_context& io_;
  std::string name_;
  client::Options options_;
  std::map<const void*, Follower> followers_;
  std::unique_ptr<cli::Link> link_;
  bool connected_ = false;
  bool refused_;
  std::string reason_;
  std::optional<v1::HelloReply> daemon_;
  net::TokenBucket requests_{kMaxRequestsPerS, kMaxRequestsPerS};
  std::uint64_t next_id_ = 2;  ///< 1 was Hello's.
  std::map<std::uint64_t, Answered> pending_;
  std::vector<Stream> streams_;
  /// The serial of each one's last subscribe() that was not refused.
  std::map<const void*, std::uint64_t> newest_;
  std::uint64_t next_serial_ = 1;               ///< For members and streams.
  std::vector<std::shared_ptr<Feed>> retired_;  ///< Until their threads have ended.
};

/// A reply that is an error.
[[nodiscard]] v1::Reply error_reply(v1::ErrorCode code, std::string sentence);

}  // namespace dtact::web
