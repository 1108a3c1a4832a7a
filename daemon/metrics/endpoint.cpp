#include "daemon/metrics/endpoint.hpp"

#include <fmt/format.h>

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/core/tcp_stream.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/version.hpp>
#include <chrono>
#include <list>
#include <stdexcept>
#include <utility>

namespace dtact::metrics {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
using boost::system::error_code;
using tcp = asio::ip::tcp;

/// Scrapers connect one after another; one connection more takes the place of the oldest.
constexpr std::size_t kMaxConnections = 8;
constexpr std::size_t kMaxHeader = 8192;  // bytes
constexpr std::chrono::seconds kTimeout{5};

using Text = std::function<std::string()>;

/// Whether a browser that names this host cannot have been led here by a name of somebody else's
/// (DNS rebinding): an address, or localhost. Programs that name none are no browsers.
bool is_own_host(std::string_view host) {
  std::string_view name = host.substr(0, host.rfind(':'));
  if (host.starts_with('[')) name = host.substr(1, host.find(']') - 1);
  error_code error;
  (void)asio::ip::make_address(std::string(name), error);
  return host.empty() || !error || name == "localhost";
}

http::response<http::string_body> answer(const http::request<http::empty_body>& request,
                                         const Text& text) {
  http::response<http::string_body> response;
  response.version(request.version());
  response.keep_alive(false);
  response.set(http::field::content_type, "text/plain; charset=utf-8");
  const auto path = request.target().substr(0, request.target().find('?'));
  const auto host = request[http::field::host];
  if (!is_own_host({host.data(), host.size()})) {
    response.result(http::status::misdirected_request);
    response.body() =
        "the metrics are those of an address or of localhost: let a proxy name that\n";
  } else if (request.method() != http::verb::get) {
    response.result(http::status::method_not_allowed);
    response.set(http::field::allow, "GET");
    response.body() = "only GET is answered\n";
  } else if (path != "/metrics") {
    response.result(http::status::not_found);
    response.body() = "the metrics are at /metrics\n";
  } else {
    response.set(http::field::content_type, "text/plain; version=0.0.4; charset=utf-8");
    response.body() = text();
  }
  response.prepare_payload();
  return response;
}

/// One request and its answer.
class Exchange : public std::enable_shared_from_this<Exchange> {
 public:
  Exchange(tcp::socket socket, const Text& text) : stream_(std::move(socket)), text_(text) {
    parser_.header_limit(kMaxHeader);
  }

  void start() {
    stream_.expires_after(kTimeout);
    http::async_read_header(stream_, buffer_, parser_,
                            [self = shared_from_this()](const error_code& error, std::size_t) {
                              if (!error) self->reply();
                            });
  }
  /// The connection ends at once.
  void close() { stream_.close(); }

 private:
  void reply() {
    response_ = answer(parser_.get(), text_);
    http::async_write(stream_, response_,
                      [self = shared_from_this()](const error_code&, std::size_t) {
                        error_code ignored;
                        self->stream_.socket().shutdown(tcp::socket::shutdown_send, ignored);
                      });
  }

  beast::tcp_stream stream_;
  Text text_;
  beast::flat_buffer buffer_{kMaxHeader};
  http::request_parser<http::empty_body> parser_;
  http::response<http::string_body> response_;
};

tcp::acceptor listen(asio::io_context& io, const EndpointConfig& config) {
  try {
    return {io, {asio::ip::make_address(config.address), config.port}};
  } catch (const boost::system::system_error& e) {
    throw std::runtime_error(fmt::format(
        "cannot serve metrics on {} port {}: {}; choose another metrics.port, or 0 for none",
        config.address, config.port, e.code().message()));
  }
}

}  // namespace

struct Endpoint::Impl : std::enable_shared_from_this<Impl> {
  Impl(asio::io_context& io, const EndpointConfig& config, Text answer)
      : acceptor(listen(io, config)), timer(io), text(std::move(answer)) {}

  void accept() {
    acceptor.async_accept([weak = weak_from_this()](const error_code& error, tcp::socket socket) {
      const auto self = weak.lock();
      if (self == nullptr || !self->acceptor.is_open()) return;
      if (error) return self->accept_later();
      self->take(std::move(socket));
      self->accept();
    });
  }

  /// Without descriptors every accept fails at once.
  void accept_later() {
    timer.expires_after(std::chrono::seconds(1));
    timer.async_wait([weak = weak_from_this()](const error_code& error) {
      const auto self = weak.lock();
      if (!error && self != nullptr && self->acceptor.is_open()) self->accept();
    });
  }

  void take(tcp::socket socket) {
    open.remove_if([](const auto& exchange) { return exchange.expired(); });
    if (open.size() >= kMaxConnections) {
      if (const auto oldest = open.front().lock()) oldest->close();
      open.pop_front();
    }
    const auto exchange = std::make_shared<Exchange>(std::move(socket), text);
    open.push_back(exchange);
    exchange->start();
  }

  tcp::acceptor acceptor;
  asio::steady_timer timer;
  Text text;
  std::list<std::weak_ptr<Exchange>> open;
};

Endpoint::Endpoint(asio::io_context& io, const EndpointConfig& config,
                   std::function<std::string()> text)
    : impl_(std::make_shared<Impl>(io, config, std::move(text))) {
  impl_->accept();
}

Endpoint::~Endpoint() { stop(); }

std::uint16_t Endpoint::port() const { return impl_->acceptor.local_endpoint().port(); }

void Endpoint::stop() {
  error_code ignored;
  impl_->acceptor.close(ignored);
  impl_->timer.cancel();
  for (const auto& weak : impl_->open) {
    if (const auto exchange = weak.lock()) exchange->close();
  }
}

}  // namespace dtact::metrics
