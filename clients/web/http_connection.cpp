#include "clients/web/http_connection.hpp"

#include <algorithm>
#include <boost/asio/ssl/stream.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/http/span_body.hpp>
#include <boost/beast/websocket.hpp>
#include <map>
#include <optional>
#include <type_traits>
#include <utility>

#include "clients/web/beast_web_socket.hpp"

namespace dtact::web {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
using asio::ip::tcp;
using boost::system::error_code;

constexpr std::uint32_t kMaxHead = 8192;
/// For TLS' handshake and a request's head; also how long a connection may lie idle.
constexpr std::chrono::seconds kTimeout{15};
/// For an answer, or the answer that opens a WebSocket, to be taken.
constexpr std::chrono::seconds kDelivery{60};

/// Nothing of unauthenticated clients': no script, style, picture or connection but from here, none
/// in the page's own text, and no other page around this one.
constexpr const char* kPolicy =
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' "
    "blob:; font-src 'self'; connect-src 'self'; worker-src 'self'; manifest-src 'self'; "
    "frame-ancestors 'none'; base-uri 'none'; form-action 'none'";

template <typename Stream>
class HttpConnection : public std::enable_shared_from_this<HttpConnection<Stream>> {
 public:
  template <typename... Arguments>
  HttpConnection(net::Peer peer, std::weak_ptr<Site> site,
                 std::shared_ptr<HttpLimits::Ticket> ticket, std::chrono::milliseconds peer_timeout,
                 Arguments&&... arguments)
      : stream_(std::make_unique<Stream>(std::forward<Arguments>(arguments)...)),
        timer_(stream_->get_executor()),
        peer_(std::move(peer)),
        site_(std::move(site)),
        ticket_(std::move(ticket)),
        peer_timeout_(peer_timeout) {}

  void start() {
    ticket_->close = [weak = this->weak_from_this()] {
      if (const auto self = weak.lock()) self->hang_up();
    };
    if constexpr (kTls) {
      wait_at_most(kTimeout);
      stream_->async_handshake(asio::ssl::stream_base::server,
                               [self = this->shared_from_this()](const error_code& error) {
                                 if (!error) self->read();
                               });
    } else {
      read();
    }
  }

 private:
  using Response = http::response<http::span_body<const char>>;
  using Parser = http::request_parser<http::empty_body>;
  using Channel = beast::websocket::stream<Stream>;
  static constexpr bool kTls = !std::is_same_v<Stream, tcp::socket>;

  void wait_at_most(std::chrono::seconds time) {
    timer_.expires_after(time);
    timer_.async_wait([weak = this->weak_from_this()](const error_code& error) {
      const auto self = weak.lock();
      if (!error && self != nullptr) self->hang_up();
    });
  }

  void hang_up() {
    timer_.cancel();
    if (stream_) hang_up(*stream_);
    if (channel_) hang_up(*channel_);
  }

  template <typename Layer>
  static void hang_up(Layer& layer) {
    error_code ignored;
    beast::get_lowest_layer(layer).close(ignored);
  }

  void read() {
    Parser& parser = parser_.emplace();
    parser.header_limit(kMaxHead);
    wait_at_most(kTimeout);
    http::async_read_header(
        *stream_, buffer_, parser,
        [self = this->shared_from_this(), &parser](const error_code& error, std::size_t) {
          self->on_head(error, parser);
        });
  }

  void on_head(const error_code& error, const Parser& parser) {
    if (error == http::error::header_limit) {
      return answer(parser.get(),
                    refusal(http::status::request_header_fields_too_large,
                            "the request's head is longer than 8192 bytes"),
                    true);
    }
    // The peer left, or it is no HTTP: an answer would not be read.
    if (error) return;
    const Request& request = parser.get();
    const auto site = site_.lock();
    if (site == nullptr) return;
    if (beast::websocket::is_upgrade(request)) {
      return upgrade(request, site->upgrade(request, peer_));
    }
    const bool body = parser.chunked() || parser.content_length().value_or(0) > 0;
    if (body)
      return answer(request, refusal(http::status::payload_too_large, "send no body"), true);
    if (request.method() != http::verb::get && request.method() != http::verb::head) {
      return answer(request,
                    refusal(http::status::method_not_allowed, "only GET and HEAD are known here"),
                    true);
    }
    answer(request, site->answer(request, peer_), !request.keep_alive());
  }

  void answer(const Request& request, Answer made, bool last) {
    if (made.delay > std::chrono::milliseconds(0)) {
      timer_.expires_after(std::exchange(made.delay, std::chrono::milliseconds(0)));
      timer_.async_wait([self = this->shared_from_this(), &request, made = std::move(made),
                         last](const error_code& error) {
        if (!error) self->answer(request, made, last);
      });
      return;
    }
    answer_ = std::move(made);
    response_ = Response(answer_.status, 11);
    response_.set(http::field::content_type,
                  beast::string_view(answer_.type.data(), answer_.type.size()));
    response_.set("Content-Security-Policy", kPolicy);
    response_.set("X-Content-Type-Options", "nosniff");
    response_.set("Referrer-Policy", "no-referrer");
    response_.set("Cross-Origin-Resource-Policy", "same-origin");
    response_.set("Cross-Origin-Opener-Policy", "same-origin");
    response_.set(http::field::cache_control, answer_.tag.empty() ? "no-store" : "no-cache");
    if (answer_.status == http::status::method_not_allowed) {
      response_.set(http::field::allow, "GET, HEAD");
    }
    if (answer_.status == http::status::unauthorized) {
      response_.set(http::field::www_authenticate, "Bearer");
    }
    std::string_view bytes = answer_.bytes.empty() ? std::string_view(answer_.text) : answer_.bytes;
    if (!answer_.tag.empty()) {
      response_.set(http::field::etag, answer_.tag);
      if (request[http::field::if_none_match] == answer_.tag) {
        response_.result(http::status::not_modified);
        bytes = {};
      }
    }
    response_.keep_alive(!last);
    response_.content_length(bytes.size());
    if (request.method() != http::verb::head) response_.body() = {bytes.data(), bytes.size()};
    wait_at_most(kDelivery);
    http::async_write(
        *stream_, response_,
        [self = this->shared_from_this(), last](const error_code& error, std::size_t) {
          if (error) return;
          if (last) return self->end();
          self->read();
        });
  }

  void end() {
    if constexpr (!kTls) {
      error_code ignored;
      stream_->shutdown(tcp::socket::shutdown_send, ignored);
    }
    // What of the peer's was not read would take the answer with it as the socket closes.
    timer_.expires_after(std::chrono::seconds(1));
    timer_.async_wait([self = this->shared_from_this()](const error_code&) {});
  }

  void upgrade(const Request& request, Upgrade wanted) {
    if (!wanted.open) return answer(request, std::move(wanted.refusal), true);
    channel_ = std::make_unique<Channel>(std::move(*stream_));
    stream_.reset();
    channel_->read_message_max(wanted.max_message);
    channel_->auto_fragment(false);
    channel_->set_option(beast::websocket::stream_base::decorator(
        [subprotocol = wanted.subprotocol](beast::websocket::response_type& response) {
          response.set(http::field::server, "dtact-web");
          if (!subprotocol.empty()) {
            response.set(http::field::sec_websocket_protocol, subprotocol);
          }
        }));
    wait_at_most(kDelivery);
    // What the peer sent behind the head waits for the answer in any case (RFC 6455, 4.1).
    channel_->async_accept(request, [self = this->shared_from_this(),
                                     wanted = std::move(wanted)](const error_code& error) {
      self->timer_.cancel();
      if (error) return;
      const auto socket =
          std::make_shared<BeastWebSocket<Stream>>(std::move(self->channel_), self->peer_timeout_);
      self->ticket_->close = [weak = std::weak_ptr(socket)] {
        if (const auto open = weak.lock()) open->close();
      };
      wanted.open(socket, std::move(self->peer_), std::move(self->ticket_));
    });
  }

  std::unique_ptr<Stream> stream_;
  std::unique_ptr<Channel> channel_;  ///< In its place, once it is being upgraded.
  asio::steady_timer timer_;
  net::Peer peer_;
  std::weak_ptr<Site> site_;
  std::shared_ptr<HttpLimits::Ticket> ticket_;
  std::chrono::milliseconds peer_timeout_;
  beast::flat_buffer buffer_{kMaxHead};
  std::optional<Parser> parser_;  ///< For the current request.
  Answer answer_;
  Response response_;
};

}  // namespace

HttpLimits::Ticket::~Ticket() {
  if (const auto open = open_.lock()) open->remove(this);
}

std::shared_ptr<HttpLimits::Ticket> HttpLimits::admit(const std::string& host) {
  std::map<std::string, std::size_t> hosts;
  for (const Ticket* ticket : *open_) ++hosts[ticket->host_];
  std::string from;  // whose oldest goes; empty: nobody's
  if (hosts[host] >= kMaxOfHost) {
    from = host;
  } else if (open_->size() >= kMax) {
    from = std::ranges::max_element(hosts, {}, [](const auto& one) { return one.second; })->first;
  }
  const auto oldest = std::ranges::find_if(
      *open_, [&](const Ticket* ticket) { return !from.empty() && ticket->host_ == from; });
  if (oldest != open_->end()) {
    const auto close = (*oldest)->close;
    open_->erase(oldest);
    close();
  }
  const std::shared_ptr<Ticket> ticket(new Ticket(open_, host));
  open_->push_back(ticket.get());
  return ticket;
}

void serve_http(tcp::socket socket, net::Peer peer, asio::ssl::context* tls,
                std::weak_ptr<Site> site, std::shared_ptr<HttpLimits::Ticket> ticket,
                std::chrono::milliseconds peer_timeout) {
  if (tls != nullptr) {
    std::make_shared<HttpConnection<asio::ssl::stream<tcp::socket>>>(
        std::move(peer), std::move(site), std::move(ticket), peer_timeout, std::move(socket), *tls)
        ->start();
  } else {
    std::make_shared<HttpConnection<tcp::socket>>(
        std::move(peer), std::move(site), std::move(ticket), peer_timeout, std::move(socket))
        ->start();
  }
}

}  // namespace dtact::web
