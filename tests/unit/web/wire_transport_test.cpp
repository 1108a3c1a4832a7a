// Texts between the wire's messages: only the newest is sent.
#include "clients/web/wire_transport.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <boost/asio/error.hpp>
#include <boost/asio/io_context.hpp>

namespace dtact::web {
namespace {

namespace asio = boost::asio;
using boost::system::error_code;

/// Remembers what is written; a write ends when the test says so.
class FakeSocket : public WebSocket {
 public:
  void read_some(asio::mutable_buffer /*into*/, OnRead done) override { read = std::move(done); }
  void write(const Parts& parts, bool text, Done done) override {
    ASSERT_EQ(pending, nullptr) << "one at a time";
    std::string bytes = text ? "text:" : "";
    for (const auto& part : parts) {
      bytes.append(static_cast<const char*>(part.data()), part.size());
    }
    written.push_back(bytes);
    pending = std::move(done);
  }
  void end(std::shared_ptr<void> /*held*/) override { written.emplace_back("end"); }
  void close() override {}
  asio::any_io_executor executor() override { return io.get_executor(); }

  void finish(const error_code& error = {}) { std::exchange(pending, nullptr)(error, 1); }

  asio::io_context io;
  std::vector<std::string> written;
  Done pending;
  OnRead read;
};

struct Rig {
  std::shared_ptr<FakeSocket> socket = std::make_shared<FakeSocket>();
  WireTransport transport{socket, {}, {}};
  int done = 0;

  void write(const std::string& bytes) {
    transport.write({asio::buffer(bytes)}, [this](const error_code&, std::size_t) { ++done; });
  }
};

using testing::ElementsAre;

TEST(WireTransport, ATextGoesAtOnceWhenNothingIsWritten) {
  Rig rig;
  rig.transport.send_text("a");
  EXPECT_THAT(rig.socket->written, ElementsAre("text:a"));
  const std::string bytes = "1";
  rig.write(bytes);
  EXPECT_EQ(rig.socket->written.size(), 1U) << "it waits";
  rig.socket->finish();
  EXPECT_THAT(rig.socket->written, ElementsAre("text:a", "1"));
  rig.socket->finish();
  EXPECT_EQ(rig.done, 1);
}

TEST(WireTransport, KeepsItsPlaceUntilThePeerIsAuthenticated) {
  auto place = std::make_shared<int>();
  const std::weak_ptr<int> kept = place;
  WireTransport transport(std::make_shared<FakeSocket>(), {}, std::move(place));
  EXPECT_FALSE(kept.expired());
  transport.on_authenticated();
  EXPECT_TRUE(kept.expired());
}

// Before: the newest alone, so that a page never heard of a loss that was over soon.
TEST(WireTransport, OfTextsThatWaitTheLastTwoGo) {
  Rig rig;
  const std::string bytes = "1";
  rig.write(bytes);
  rig.transport.send_text("a");
  rig.transport.send_text("away");
  rig.transport.send_text("there");
  rig.socket->finish();
  EXPECT_EQ(rig.done, 1);
  rig.socket->finish();
  EXPECT_THAT(rig.socket->written, ElementsAre("1", "text:away", "text:there"));
  rig.transport.send_text("c");
  rig.transport.shutdown_send(nullptr);
  rig.socket->finish();
  EXPECT_THAT(rig.socket->written, ElementsAre("1", "text:away", "text:there", "end"));
}

TEST(WireTransport, ClientsSendNoTexts) {
  Rig rig;
  error_code reported;
  rig.transport.read_some({}, [&](const error_code& error, std::size_t) { reported = error; });
  rig.socket->read({}, {3, true, true});
  EXPECT_EQ(reported, asio::error::operation_not_supported);
}

TEST(WireTransport, ATextMayOutliveIt) {
  const auto socket = std::make_shared<FakeSocket>();
  {
    WireTransport transport(socket, {}, {});
    transport.send_text("a");
  }
  socket->finish();
  EXPECT_THAT(socket->written, ElementsAre("text:a"));
}

}  // namespace
}  // namespace dtact::web
