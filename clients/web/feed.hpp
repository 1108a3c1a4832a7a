#pragma once

#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>

#include "clients/common/link.hpp"
#include "clients/cpp/options.hpp"
#include "clients/web/relayed_frame.hpp"

namespace dtact::web {

/// One subscription at a daemon over a connection of its own. Keeps only the newest frame until it
/// is taken.
class Feed {
 public:
  /// All on the feed's own thread.
  struct Handlers {
    /// To Subscribe, after each connection; an error when there is none.
    std::function<void(const v1::Reply&)> answered;
    std::function<void()> frame;  ///< take() has one.
  };

  Feed(client::Options options, const v1::Subscribe& subscription, Handlers handlers);

  struct Taken {
    RelayedFrame frame;
    std::uint64_t missed = 0;  ///< Between the one taken before and this.
  };
  /// The newest frame that was not taken yet. From any thread.
  [[nodiscard]] std::optional<Taken> take();
  /// See Link.
  void use(client::Options options) { link_.use(std::move(options)); }
  void stop() noexcept { link_.stop(); }
  [[nodiscard]] bool ended() const noexcept { return link_.ended(); }

 private:
  void on_message(const std::string& bytes);

  Handlers handlers_;
  std::string request_;  ///< Subscribe, serialized.
  std::mutex mutex_;     ///< Guards the next two.
  std::optional<RelayedFrame> newest_;
  std::uint64_t missed_ = 0;
  std::uint64_t dropped_ = 0;  ///< By the daemon, on this connection.
  cli::Link link_;             ///< Last: its thread uses the others.
};

}  // namespace dtact::web
