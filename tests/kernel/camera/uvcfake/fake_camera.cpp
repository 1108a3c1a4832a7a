#include "tests/kernel/camera/uvcfake/fake_camera.hpp"

#include <endian.h>
#include <fcntl.h>
#include <sys/socket.h>
#include <sys/timerfd.h>
#include <sys/uio.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>
#include <thread>

#include "hal/base/atomic_file.hpp"

namespace uvcfake {
namespace {

namespace fs = std::filesystem;

constexpr const char* kController = "/sys/devices/platform/vhci_hcd.0";
constexpr int kLongestRelease_ms = 10000;
constexpr std::size_t kPayloadBytes = 16384;  // of a bulk transfer
constexpr std::uint32_t kIsoPayloadBytes = 3072;
constexpr std::size_t kMaxMessage = 1U << 17U;
constexpr std::size_t kMaxIsoPackets = 128;

// Fields of the probe/commit block (UVC 1.0, table 4-47).
constexpr std::size_t kFormatAt = 2;
constexpr std::size_t kFrameAt = 3;
constexpr std::size_t kIntervalAt = 4;
constexpr std::size_t kFrameBytesAt = 18;
constexpr std::size_t kPayloadBytesAt = 22;

// Bits of the payload header.
constexpr std::uint8_t kEndOfFrame = 0x02;
constexpr std::uint8_t kError = 0x40;
constexpr std::uint8_t kEndOfHeader = 0x80;

std::uint32_t get_u32(std::span<const std::uint8_t> block, std::size_t at) {
  std::uint32_t v = 0;
  std::memcpy(&v, &block[at], sizeof v);
  return le32toh(v);
}

void put_u32(std::span<std::uint8_t> block, std::size_t at, std::uint32_t v) {
  v = htole32(v);
  std::memcpy(&block[at], &v, sizeof v);
}

bool read_all(int fd, void* to, std::size_t n) {
  auto* p = static_cast<char*>(to);
  while (n > 0) {
    const ssize_t k = ::read(fd, p, n);
    if (k < 0 && errno == EINTR) continue;
    if (k <= 0) return false;
    p += k;
    n -= static_cast<std::size_t>(k);
  }
  return true;
}

bool write_all(int fd, const void* from, std::size_t n) {
  const auto* p = static_cast<const char*>(from);
  while (n > 0) {
    const ssize_t k = ::send(fd, p, n, MSG_NOSIGNAL);
    if (k < 0 && errno == EINTR) continue;
    if (k <= 0) return false;
    p += k;
    n -= static_cast<std::size_t>(k);
  }
  return true;
}

bool port_is_free(int port) {
  const fs::path path = fs::path(kController) / "status";
  std::ifstream status(path);
  int number = 0;
  int state = 0;
  constexpr int kFree = 4;  // VDEV_ST_NULL, enum usbip_device_status
  for (std::string line; std::getline(status, line);) {
    // "hs  0000 004 …": hub, port, state
    if (std::sscanf(line.c_str(), "%*s %d %d", &number, &state) == 2 && number == port) {
      return state == kFree;
    }
  }
  throw std::runtime_error("no port " + std::to_string(port) + " in " + path.string());
}

}  // namespace

FakeCamera::FakeCamera(const Options& options)
    : options_(options),
      configuration_(configuration_descriptor(options.isochronous)),
      timer_(::timerfd_create(CLOCK_MONOTONIC, TFD_CLOEXEC)),
      scratch_(kMaxMessage) {
  for (const auto& [name, fault] : options_.faults) controls_.set_fault(name, fault);
  probe_[kFormatAt] = kMjpeg;
  probe_[kFrameAt] = 1;
  negotiate();
  load_frames();
  plug_in();
}

void FakeCamera::load_frames() {
  std::vector<fs::path> paths;
  for (const auto& entry : fs::directory_iterator(options_.folder)) paths.push_back(entry.path());
  std::ranges::sort(paths);
  for (const fs::path& path : paths) {
    if (path.extension() != ".jpg" && path.extension() != ".yuv") continue;
    const std::string content = dtact::base::read_file(path);
    frames_[path.extension() == ".yuv"].emplace_back(content.begin(), content.end());
  }
  std::fprintf(stderr, "uvcfake: %zu MJPEG, %zu YUYV frames, %s\n", frames_[0].size(),
               frames_[1].size(), options_.isochronous ? "isochronous" : "bulk");
}

void FakeCamera::plug_in() {
  std::array<int, 2> ends{};
  if (::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends.data()) != 0) {
    throw std::runtime_error("no socket pair");
  }
  socket_.reset(ends[0]);
  const dtact::base::UniqueFd other(ends[1]);
  const fs::path path = fs::path(kController) / "attach";
  const dtact::base::UniqueFd attach(::open(path.c_str(), O_WRONLY | O_CLOEXEC));
  constexpr int kHighSpeed = 3;  // enum usb_device_speed
  std::array<char, 64> line{};
  const int n = std::snprintf(line.data(), line.size(), "%d %d %d %d", options_.port, other.get(),
                              0x10001 + options_.port, kHighSpeed);
  if (!attach || ::write(attach.get(), line.data(), static_cast<std::size_t>(n)) != n) {
    throw std::runtime_error("cannot attach: " + path.string() + ": " + std::strerror(errno));
  }
  std::fprintf(stderr, "uvcfake: plugged in\n");
}

void FakeCamera::reply(std::uint32_t sequence, int status, std::span<const std::uint8_t> data,
                       int actual, std::span<const usbip::IsoPacket> packets) {
  usbip::Header header{};
  header.command = htobe32(usbip::kSubmitReply);
  header.sequence = htobe32(sequence);
  header.reply.status = htobe32(static_cast<std::uint32_t>(status));
  header.reply.actual = htobe32(static_cast<std::uint32_t>(actual));
  header.reply.packets = htobe32(static_cast<std::uint32_t>(packets.size()));
  if (!write_all(socket_.get(), &header, sizeof header) ||
      !write_all(socket_.get(), data.data(), data.size()) ||
      !write_all(socket_.get(), packets.data(), packets.size_bytes())) {
    broken_ = true;
  }
}

// The next payload of the frame under way: a two-byte header and data; 0 = nothing to send.
std::size_t FakeCamera::next_payload(std::uint8_t* to, std::size_t room) {
  if (current_.empty() || room < 3) return 0;
  const std::size_t n = std::min(current_.size(), room - 2);
  std::memcpy(to + 2, current_.data(), n);
  current_ = current_.subspan(n);
  to[0] = 2;
  to[1] = static_cast<std::uint8_t>(kEndOfHeader | frame_id_ | (flagged_ ? kError : 0));
  if (current_.empty()) {
    to[1] |= kEndOfFrame;
    frame_id_ ^= 1U;
    ++sent_;
  }
  return n + 2;
}

// Hands data to waiting transfers. Isochronous ones also complete empty, as time passes.
void FakeCamera::pump(bool time_passed) {
  while (!waiting_.empty() && !broken_ &&
         (!current_.empty() || (time_passed && !waiting_.front().packets.empty()))) {
    Transfer& transfer = waiting_.front();
    std::size_t n = 0;
    if (transfer.packets.empty()) {
      n = next_payload(scratch_.data(), std::min(transfer.length, kPayloadBytes));
    }
    for (usbip::IsoPacket& packet : transfer.packets) {
      const std::size_t k = next_payload(scratch_.data() + n, be32toh(packet.length));
      packet.actual = htobe32(static_cast<std::uint32_t>(k));
      packet.status = 0;
      n += k;
    }
    reply(transfer.sequence, 0, {scratch_.data(), n}, static_cast<int>(n), transfer.packets);
    waiting_.pop_front();
    if (n == 0) break;
  }
}

void FakeCamera::stop() {
  streaming_ = false;
  current_ = {};
}

void FakeCamera::start() {
  stop();
  streaming_ = true;
  const double interval_s =
      options_.fps > 0 ? 1 / options_.fps : get_u32(probe_, kIntervalAt) * 1e-7;
  const timespec period{.tv_sec = static_cast<time_t>(interval_s),
                        .tv_nsec = std::lround(std::fmod(interval_s, 1.0) * 1e9)};
  const itimerspec times{.it_interval = period, .it_value = period};
  ::timerfd_settime(timer_.get(), 0, &times, nullptr);
  std::fprintf(stderr, "uvcfake: streams format %d frame %d every %.1f ms\n", probe_[kFormatAt],
               probe_[kFrameAt], interval_s * 1e3);
}

void FakeCamera::toggle_freeze() {
  frozen_ = !frozen_;
  std::fprintf(stderr, "uvcfake: %s\n", frozen_ ? "frozen" : "running");
}

void FakeCamera::handle_timer() {
  std::uint64_t periods = 0;
  if (::read(timer_.get(), &periods, sizeof periods) != sizeof periods) return;
  const auto& frames = frames_[probe_[kFormatAt] == kYuyv];
  if (streaming_ && !waiting_.empty() && !frozen_ && !frames.empty()) {
    dropped_ += static_cast<unsigned>(periods - 1);
    if (!current_.empty()) {
      ++dropped_;
    } else {
      current_ = frames[played_ % frames.size()];
      ++played_;
      if (options_.cut_every > 0 && played_ % options_.cut_every == 0) {
        current_ = current_.first(current_.size() / 2);
      }
      flagged_ = options_.flag_every > 0 && played_ % options_.flag_every == 0;
    }
  }
  pump(true);
}

// Settles the probe block on the nearest offer.
void FakeCamera::negotiate() {
  if (probe_[kFormatAt] != kYuyv) probe_[kFormatAt] = kMjpeg;
  if (probe_[kFrameAt] < 1 || probe_[kFrameAt] > kSizes.size()) probe_[kFrameAt] = 1;
  const std::int64_t asked = get_u32(probe_, kIntervalAt);
  const auto nearest = std::ranges::min_element(
      kIntervals, {}, [&](std::uint32_t interval) { return std::llabs(interval - asked); });
  put_u32(probe_, kIntervalAt, asked == 0 ? kIntervals[0] : *nearest);
  const Size size = kSizes[probe_[kFrameAt] - 1U];
  put_u32(probe_, kFrameBytesAt, size.width * size.height * 2U);
  put_u32(probe_, kPayloadBytesAt,
          options_.isochronous ? kIsoPayloadBytes : static_cast<std::uint32_t>(kPayloadBytes));
}

int FakeCamera::standard_request(std::span<const std::uint8_t, 8> setup,
                                 std::span<std::uint8_t> data) {
  const int request = setup[1];
  if (request == 6) {  // GET_DESCRIPTOR: type in setup[3], index in setup[2]
    const Bytes d = setup[3] == 1   ? device_descriptor()
                    : setup[3] == 2 ? configuration_
                    : setup[3] == 3 ? string_descriptor(setup[2], options_.serial)
                                    : Bytes{};
    if (d.empty()) return -EPIPE;
    std::ranges::copy(d, data.begin());
    return static_cast<int>(d.size());
  }
  if ((setup[0] & 0x80U) != 0) {  // GET_STATUS, GET_CONFIGURATION, GET_INTERFACE
    data[0] = request == 8 ? 1 : 0;
    data[1] = 0;
    return request == 0 ? 2 : 1;
  }
  constexpr int kClearFeature = 1;
  constexpr int kSetInterface = 11;
  if (request == kSetInterface && setup[2] != 0) {
    start();
  } else if (request == kSetInterface || request == kClearFeature) {
    stop();
  }
  return 0;
}

int FakeCamera::streaming_request(int request, bool commit, std::span<std::uint8_t> data) {
  switch (request) {
    case 0x01:  // SET_CUR
      std::copy_n(data.begin(), probe_.size(), probe_.begin());
      negotiate();
      // An isochronous stream starts with its interface setting.
      if (commit && !options_.isochronous) start();
      return static_cast<int>(probe_.size());
    case 0x85:  // GET_LEN
      data[0] = static_cast<std::uint8_t>(probe_.size());
      data[1] = 0;
      return 2;
    case 0x86:  // GET_INFO
      data[0] = 3;
      return 1;
    default: {  // GET_CUR, GET_MIN, GET_MAX, GET_DEF
      const auto kept = probe_;
      if (request != 0x81) {
        put_u32(probe_, kIntervalAt, request == 0x83 ? kIntervals.back() : kIntervals.front());
        negotiate();
      }
      std::ranges::copy(probe_, data.begin());
      probe_ = kept;
      return static_cast<int>(probe_.size());
    }
  }
}

void FakeCamera::answer_control(const usbip::Header& header, std::span<std::uint8_t> data) {
  const std::span<const std::uint8_t, 8> setup(header.submit.setup);
  const bool to_host = header.direction != 0;
  const int asked = setup[6] | setup[7] << 8;
  int n = -EPIPE;
  if ((setup[0] & 0x60U) == 0) {
    n = standard_request(setup, data);
  } else if (setup[0] == 0x21 || setup[0] == 0xa1) {
    const int interface = setup[4];
    const int entity = setup[5];
    const int selector = setup[3];
    if (interface == 1 && (selector == 1 || selector == 2)) {
      n = streaming_request(setup[1], selector == 2, data);
    } else if (interface == 0 && entity == 0) {
      data[0] = 6;  // request error code: invalid control
      n = 1;
    } else if (interface == 0) {
      n = controls_.handle(entity, selector, setup[1], data).value_or(-EPIPE);
    }
  }
  n = std::min(n, asked);
  const std::size_t answered = to_host && n > 0 ? static_cast<std::size_t>(n) : 0;
  reply(be32toh(header.sequence), std::min(n, 0), data.first(answered), std::max(n, 0), {});
}

void FakeCamera::unlink(const usbip::Header& header) {
  const std::uint32_t victim = be32toh(header.unlink_sequence);
  const auto removed =
      std::erase_if(waiting_, [&](const Transfer& t) { return t.sequence == victim; });
  usbip::Header answer{};
  answer.command = htobe32(usbip::kUnlinkReply);
  answer.sequence = header.sequence;
  answer.reply.status = htobe32(static_cast<std::uint32_t>(removed > 0 ? -ECONNRESET : 0));
  if (!write_all(socket_.get(), &answer, sizeof answer)) broken_ = true;
}

bool FakeCamera::handle_message() {
  usbip::Header header{};
  if (!read_all(socket_.get(), &header, sizeof header)) return false;
  if (be32toh(header.command) == usbip::kUnlink) {
    unlink(header);
    return !broken_;
  }
  header.direction = be32toh(header.direction);
  const std::size_t length = be32toh(header.submit.length);
  const std::uint32_t count = be32toh(header.submit.packets);
  std::vector<usbip::IsoPacket> packets(count <= kMaxIsoPackets ? count : 0);
  if (length > scratch_.size()) return false;
  if (header.direction == 0 && !read_all(socket_.get(), scratch_.data(), length)) return false;
  if (!read_all(socket_.get(), packets.data(), packets.size() * sizeof(usbip::IsoPacket))) {
    return false;
  }
  if (header.endpoint == 0) {
    answer_control(header, scratch_);
  } else {
    waiting_.push_back({be32toh(header.sequence), length, std::move(packets)});
    pump(false);
  }
  return !broken_;
}

// Says that nothing more comes, reads what the controller still sends, and waits until its port is
// free. Between the end of vhci-hcd's sending thread and the moment when the port is free, a
// cancelled transfer that waits for that thread is not given back, so that VIDIOC_STREAMOFF hangs
// (Linux 6.1, vhci_urb_dequeue and vhci_device_unlink_cleanup).
void FakeCamera::unplug() {
  ::shutdown(socket_.get(), SHUT_WR);
  ssize_t n = 0;
  do {
    n = ::read(socket_.get(), scratch_.data(), scratch_.size());
  } while (n > 0 || (n < 0 && errno == EINTR));
  for (int waited_ms = 0; !port_is_free(options_.port); ++waited_ms) {
    if (waited_ms == kLongestRelease_ms) throw std::runtime_error("the controller keeps the port");
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
}

}  // namespace uvcfake
