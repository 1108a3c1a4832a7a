#pragma once

#include <linux/videodev2.h>
#include <umockdev.h>

#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

namespace dtact::hal::v4l2 {

/// Contents of a buffer that the emulated driver fills.
struct EmulatedBuffer {
  std::vector<std::uint8_t> payload;
  std::uint32_t sequence = 0;
  std::uint32_t flags = V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC | V4L2_BUF_FLAG_TSTAMP_SRC_SOE;
  std::int64_t timestamp_us = -1;  ///< −1 = now.
  std::uint32_t index_offset = 0;  ///< Added to the index: a faulty driver.
};

/// /dev/video0 emulated in this process by libumockdev: a camera of 32×16 GREY at 60 frames a
/// second with five controls, whose every system call can be made to fail. Needs
/// libumockdev-preload.
class EmulatedCamera {
 public:
  static constexpr std::uint32_t kWidth = 32;
  static constexpr std::uint32_t kHeight = 16;

  EmulatedCamera();
  EmulatedCamera(const EmulatedCamera&) = delete;
  EmulatedCamera& operator=(const EmulatedCamera&) = delete;
  ~EmulatedCamera();

  /// Every call of `request` fails with this errno from now on; 0 = works again.
  void fail(unsigned long request, int error, int times = -1);
  /// The next free buffers are filled with these, one each.
  void deliver(const EmulatedBuffer& buffer);
  /// A picture of one grey value.
  void deliver_grey(std::uint8_t value, std::uint32_t sequence);
  void set_pixel_format(std::uint32_t fourcc);
  void set_driver(const std::string& name);
  /// The width that S_FMT answers for every request; 0 = as requested.
  void insist_on_width(std::uint32_t width);
  void insist_on_rate(std::uint32_t fps);
  void grant_buffers(std::uint32_t count);
  /// The camera has no serial number then; its hub has one.
  void forget_serial() const;
  void set_control(std::uint32_t id, std::int32_t value);
  /// uvcvideo does this with controls that the camera doesn't call AUTO_UPDATE: it asks once and
  /// answers from a copy from then on, in which settings are entered.
  void answer_from_a_copy(std::uint32_t id);
  /// Accepts every value without an error and keeps its own.
  void ignore(std::uint32_t id);
  void refuse(std::uint32_t id);
  /// Rounds values to whole steps from its minimum, as the kernel does.
  void set_step(std::uint32_t id, std::int32_t step);
  [[nodiscard]] std::int32_t control(std::uint32_t id) const;
  [[nodiscard]] bool streaming() const;

 private:
  struct Control {
    const char* name;
    std::int32_t minimum, maximum, initial, value;
    bool copied = false;
    std::optional<std::int32_t> copy = {};
    bool ignored = false, refused = false;
    std::int32_t step = 1;
  };
  void count_transfer() const;
  static gboolean on_ioctl(UMockdevIoctlBase*, UMockdevIoctlClient* client, gpointer self);
  void handle(UMockdevIoctlClient* client);
  int answer(unsigned long request, std::vector<std::uint8_t>& argument);
  int dequeue(v4l2_buffer& buffer);
  [[nodiscard]] std::uint32_t buffer_bytes() const;

  UMockdevTestbed* testbed_;
  UMockdevIoctlBase* handler_;
  std::string root_;     // root of the emulated folders
  std::string backing_;  // the file behind the node, which is mapped
  mutable std::mutex mutex_;
  std::map<unsigned long, std::pair<int, int>> failures_;  // request → errno, times left
  std::deque<EmulatedBuffer> pending_;
  std::deque<std::uint32_t> queued_;
  std::map<std::uint32_t, Control> controls_;
  std::string driver_ = "emulated";
  std::uint32_t fourcc_ = V4L2_PIX_FMT_GREY;
  std::uint32_t forced_width_ = 0;
  std::uint32_t forced_fps_ = 0;
  std::uint32_t granted_ = 4;
  bool streaming_ = false;
};

}  // namespace dtact::hal::v4l2
