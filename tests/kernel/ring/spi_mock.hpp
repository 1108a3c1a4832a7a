#pragma once

#include <gtest/gtest.h>

#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "hal/light_ring.hpp"
#include "tests/kernel/ring/guest.hpp"
#include "tests/unit/ws2812/chain_model.hpp"

/// The module spi-mock (tests/kernel/modules): an SPI controller that records its transfers.
namespace dtact::kernel_test::spi_mock {

/// One transfer as the controller saw it; the layout is the module's.
struct Transfer {
  struct Head {
    std::uint64_t start_ns;
    std::uint32_t speed_hz;
    std::uint32_t bytes;
    std::uint8_t mode, word, cs_change, flags;
    std::uint32_t delay_us;
  };
  Head head;
  std::vector<std::uint8_t> data;
};
static_assert(sizeof(Transfer::Head) == 24);

inline std::string file(const std::string& name) { return "/sys/kernel/debug/spi_mock/" + name; }
inline void set(const std::string& knob, int value) {
  write_text(file(knob), std::to_string(value));
}
inline void forget() { set("log", 0); }

inline std::vector<Transfer> recorded() {
  const std::string log = read_text(file("log"));
  std::vector<Transfer> transfers;
  for (std::size_t at = 0; at + sizeof(Transfer::Head) <= log.size();) {
    Transfer transfer{};
    std::memcpy(&transfer.head, log.data() + at, sizeof transfer.head);
    at += sizeof transfer.head;
    transfer.data.assign(log.begin() + static_cast<std::ptrdiff_t>(at),
                         log.begin() + static_cast<std::ptrdiff_t>(at + transfer.head.bytes));
    at += transfer.head.bytes;
    transfers.push_back(std::move(transfer));
  }
  return transfers;
}

/// Transfers that are not only zeros, which LEDs ignore.
inline std::vector<Transfer> pictures() {
  std::vector<Transfer> found;
  for (Transfer& transfer : recorded()) {
    if (transfer.data != std::vector<std::uint8_t>(transfer.data.size(), 0)) {
      found.push_back(std::move(transfer));
    }
  }
  return found;
}

/// The colours that LEDs on the wire would show after a transfer.
inline std::vector<hal::Rgb> shown_by(const Transfer& transfer) {
  hal::ws2812::test::ChainModel chain;
  chain.spi(transfer.data, transfer.head.speed_hz);
  EXPECT_EQ(chain.odd_pulses(), 0);
  return chain.shown();
}

inline void shell(const std::string& command) {
  if (std::system(command.c_str()) != 0) throw std::runtime_error("failed: " + command);
}
inline void load() { shell("insmod $KERNEL_CACHE/modules/spi-mock.ko"); }
inline void unload() { shell("rmmod spi_mock"); }

}  // namespace dtact::kernel_test::spi_mock
