// The wire before devices that are not the driver's, and before a double of what the driver takes;
// tests/kernel/ring/pio_ring_test.cpp has the kernel's.
#include "hal/ws2812/pio_wire.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cerrno>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <span>
#include <vector>

#include "hal/base/atomic_file.hpp"
#include "tests/fakes/own_path.hpp"
#include "tests/unit/ws2812/fakes.hpp"

namespace dtact::hal::ws2812 {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;

using Bytes = std::vector<std::uint8_t>;

/// Takes this thread's writes to character devices while it lives, as ws2812-pio-rp1 does for
/// `leds` LEDs of four bytes each.
class DriverDouble {
 public:
  explicit DriverDouble(std::size_t leds) : bytes_(4 * leds) { present() = this; }
  DriverDouble(const DriverDouble&) = delete;
  DriverDouble& operator=(const DriverDouble&) = delete;
  ~DriverDouble() { present() = nullptr; }

  static DriverDouble*& present() {
    static thread_local DriverDouble* one = nullptr;
    return one;
  }
  ssize_t write(std::span<const std::uint8_t> bytes) {
    writes.emplace_back(bytes.begin(), bytes.end());
    errno = error != 0 ? error : bytes.size() > bytes_ ? EFBIG : 0;
    if (errno != 0) return -1;
    return bytes.size() < bytes_ ? static_cast<ssize_t>(bytes.size()) : taken(bytes.size());
  }

  std::vector<Bytes> writes;
  int error = 0;  // of every write
  /// What a write for all LEDs returns.
  std::function<ssize_t(std::size_t)> taken = [](std::size_t size) {
    return static_cast<ssize_t>(size);
  };

 private:
  std::size_t bytes_;
};

/// A device's name that leads to one character device and then to another.
class Node {
 public:
  Node() : path_(fakes::own_path(".leds")) { lead_to("/dev/null"); }
  Node(const Node&) = delete;
  Node& operator=(const Node&) = delete;
  ~Node() { std::filesystem::remove(path_); }

  void lead_to(const std::filesystem::path& device) {
    std::filesystem::remove(path_);
    std::filesystem::create_symlink(device, path_);
  }
  [[nodiscard]] std::string path() const { return path_.string(); }

 private:
  std::filesystem::path path_;
};

const std::vector<Rgb> kThree{{1, 2, 3}, {40, 50, 60}, {255, 0, 128}};
const Bytes kThreeSent{1, 2, 3, 0, 40, 50, 60, 0, 255, 0, 128, 0};

std::string refusal_of(const std::string& device) {
  test::FakeClock clock;
  return PioWire(device, clock).prepare(8);
}

TEST(Ws2812PioWire, ADeviceThatIsNotThereNamesTheOverlay) {
  EXPECT_THAT(refusal_of("/dev/leds99"),
              AllOf(HasSubstr("/dev/leds99: write failed: No such file or directory"),
                    HasSubstr("dtoverlay=ws2812-pio,gpio=<the data line's GPIO>,num_leds=8"),
                    HasSubstr("ring.backend = \"ws2812_spi\"")));
}

TEST(Ws2812PioWire, AFileIsNoDeviceAndStaysAsItIs) {
  const std::filesystem::path file = fakes::own_path();
  base::write_file_atomically(file, "mine");
  EXPECT_THAT(refusal_of(file), HasSubstr("No such device"));
  EXPECT_EQ(base::read_file(file), "mine");
  std::filesystem::remove(file);
}

TEST(Ws2812PioWire, ADeviceThatTakesEveryLengthHasMoreLeds) {
  EXPECT_THAT(refusal_of("/dev/null"),
              AllOf(HasSubstr("the driver has more than the ring's 8 LEDs"),
                    HasSubstr("set num_leds=8 in the line dtoverlay=ws2812-pio")));
}

TEST(Ws2812PioWire, AnyOtherErrorIsNamed) {
  EXPECT_THAT(refusal_of("/dev/full"), AllOf(HasSubstr("No space left"), HasSubstr("dmesg")));
}

// A brightness of 0 turns the driver's gamma table off. One LED more is too many, eight are not.
TEST(Ws2812PioWire, PreparesADriverOfAsManyLedsAndLeavesThemDark) {
  const Node node;
  DriverDouble driver(3);
  test::FakeClock clock;
  const std::int64_t begin = clock.now;
  PioWire wire(node.path(), clock);
  EXPECT_EQ(wire.prepare(3), "");
  EXPECT_THAT(driver.writes, ElementsAre(Bytes(1, 0), Bytes(16, 0), Bytes(12, 0)));
  EXPECT_GE(clock.now - begin, 50'000'000) << "the driver sends an incomplete write after HZ / 20";
  EXPECT_FALSE(wire.lost());
}

TEST(Ws2812PioWire, ADriverOfFewerLedsIsRefused) {
  const Node node;
  DriverDouble driver(7);
  EXPECT_THAT(refusal_of(node.path()), AllOf(HasSubstr("the driver has fewer than the ring's 8"),
                                             HasSubstr("set num_leds=8")));
  EXPECT_EQ(driver.writes.size(), 3U);
}

TEST(Ws2812PioWire, SendsRedGreenBlueAndNoWhite) {
  const Node node;
  DriverDouble driver(3);
  test::FakeClock clock;
  PioWire wire(node.path(), clock);
  ASSERT_EQ(wire.prepare(3), "");
  driver.writes.clear();
  const std::int64_t begin = clock.now;
  EXPECT_EQ(wire.send(kThree), "");
  EXPECT_THAT(driver.writes, ElementsAre(kThreeSent));
  // Three LEDs of 24 bits at 1.25 us, then a pause of 280 us at least.
  EXPECT_GE(clock.now - begin, 3 * 24 * 1250 + 280'000);
  EXPECT_LT(clock.now - begin, 1'000'000);
}

// A driver that takes a part of it, or nothing, and gives no reason.
TEST(Ws2812PioWire, AWriteThatIsNotWholeHasFailed) {
  const Node node;
  DriverDouble driver(3);
  test::FakeClock clock;
  PioWire wire(node.path(), clock);
  ASSERT_EQ(wire.prepare(3), "");
  for (const ssize_t taken : {0, 11}) {
    driver.taken = [taken](std::size_t) { return taken; };
    EXPECT_THAT(wire.send(kThree), HasSubstr("write failed: Input/output error")) << taken;
    EXPECT_FALSE(wire.lost());
    EXPECT_THAT(PioWire(node.path(), clock).prepare(3), HasSubstr("Input/output error")) << taken;
  }
}

TEST(Ws2812PioWire, EveryErrorHasItsFix) {
  const Node node;
  DriverDouble driver(8);
  for (const auto& [error, fix] : {std::pair{EPERM, "DeviceAllow="},
                                   {EACCES, "usermod -aG gpio"},
                                   {ENODEV, "dtoverlay=ws2812-pio,gpio="},
                                   {ENXIO, "dtoverlay=ws2812-pio,gpio="},
                                   {EIO, "dmesg) for the driver's own words"}}) {
    driver.error = error;
    EXPECT_THAT(refusal_of(node.path()), HasSubstr(fix)) << error;
  }
}

TEST(Ws2812PioWire, ADeviceThatWasMadeAnewIsPreparedAnew) {
  Node node;
  DriverDouble driver(3);
  test::FakeClock clock;
  PioWire wire(node.path(), clock);
  ASSERT_EQ(wire.prepare(3), "");
  driver.error = EIO;
  EXPECT_NE(wire.send(kThree), "");
  EXPECT_FALSE(wire.lost()) << "the device is there";
  driver.error = ENODEV;
  EXPECT_NE(wire.send(kThree), "");
  EXPECT_TRUE(wire.lost());

  driver.error = 0;
  driver.writes.clear();
  node.lead_to("/dev/zero");
  EXPECT_EQ(wire.send(kThree), "");
  EXPECT_FALSE(wire.lost());
  EXPECT_THAT(driver.writes, ElementsAre(Bytes(1, 0), Bytes(16, 0), Bytes(12, 0), kThreeSent));
  driver.writes.clear();
  EXPECT_EQ(wire.send(kThree), "");
  EXPECT_THAT(driver.writes, ElementsAre(kThreeSent));
}

TEST(Ws2812PioWire, ADeviceThatWasMadeAnewForOtherLedsIsLost) {
  Node node;
  test::FakeClock clock;
  PioWire wire(node.path(), clock);
  {
    DriverDouble driver(3);
    ASSERT_EQ(wire.prepare(3), "");
    EXPECT_EQ(driver.writes.size(), 3U);
  }
  node.lead_to("/dev/zero");
  DriverDouble longer(4);
  EXPECT_THAT(wire.send(kThree), HasSubstr("the driver has more than the ring's 3 LEDs"));
  EXPECT_TRUE(wire.lost());
  for (const Bytes& write : longer.writes) EXPECT_EQ(write, Bytes(write.size(), 0));
}

}  // namespace
}  // namespace dtact::hal::ws2812

// The C library's own function, which this one replaces: an executable's symbols come first.
extern "C" ssize_t write(int fd, const void* bytes, size_t size) {
  using dtact::hal::ws2812::DriverDouble;
  struct stat status{};
  if (DriverDouble::present() != nullptr && ::fstat(fd, &status) == 0 && S_ISCHR(status.st_mode)) {
    return DriverDouble::present()->write({static_cast<const std::uint8_t*>(bytes), size});
  }
  return static_cast<ssize_t>(::syscall(SYS_write, fd, bytes, size));
}
