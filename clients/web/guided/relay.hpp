#pragma once

#include <array>
#include <boost/asio/steady_timer.hpp>
#include <deque>
#include <functional>
#include <memory>
#include <string>

#include "clients/web/guided/child.hpp"
#include "clients/web/web_socket.hpp"

namespace dtact::web::guided {

/// One session of GuidedEndpoint: a page's WebSocket and dtact-calibrate, which is ended with it.
/// Both speak clients/common/guided.proto in JSON. On one thread.
class Relay : public std::enable_shared_from_this<Relay> {
 public:
  /// The WebSocket lets no longer message through, bytes.
  static constexpr std::size_t kMaxMessage = 4096;

  struct Handlers {
    /// The page's first message. Starts the program with `handlers`, or throws with a sentence for
    /// the page.
    std::function<std::shared_ptr<Child>(const std::string& start, Relay&,
                                         Child::Handlers handlers)>
        begin;
    std::function<void()> ended;  ///< Once.
  };

  Relay(std::shared_ptr<WebSocket> socket, Handlers handlers);

  void start();
  /// In place of start(): says why not.
  void refuse(const std::string& sentence);
  /// Says why, and lets the page go once it has read that.
  void finish(const std::string& error);
  /// Ends it at once.
  void close() { over(); }
  /// A message to the page (a GuidedLine as JSON). Only the newest waiting scene is sent.
  void send_text(std::string text);
  [[nodiscard]] boost::asio::any_io_executor executor() { return socket_->executor(); }

 private:
  void read();
  void queue(std::string text);
  void take(const std::string& message);
  void write_next();
  void on_child_ended(int status, const std::string& errors);
  void over();

  std::shared_ptr<WebSocket> socket_;
  Handlers handlers_;
  std::shared_ptr<Child> child_;
  std::array<char, kMaxMessage> piece_{};
  std::string received_;
  std::deque<std::string> texts_;
  std::string scene_;  ///< The newest, waiting; empty: none is.
  bool writing_ = false;
  bool finished_ = false;  ///< Nothing comes after what waits.
  bool over_ = false;
  boost::asio::steady_timer linger_;  ///< Closes the page after its last message.
};

}  // namespace dtact::web::guided
