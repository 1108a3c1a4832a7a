#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "hal/base/unique_fd.hpp"
#include "tests/kernel/camera/uvcfake/controls.hpp"
#include "tests/kernel/camera/uvcfake/descriptors.hpp"
#include "tests/kernel/camera/uvcfake/usbip.hpp"

namespace uvcfake {

struct Options {
  bool isochronous = false;  ///< Like most cameras; else bulk.
  double fps = 0;            ///< Forced rate; 0 = as negotiated.
  unsigned cut_every = 0;    ///< Every n-th frame is cut in half.
  unsigned flag_every = 0;   ///< Every n-th frame carries the payload header's error bit.
  std::vector<std::pair<std::string, Fault>> faults;  ///< Faults of controls, by name.
  int port = 0;                                       ///< Port of the virtual host controller.
  std::string serial = "0001";
  std::string folder;  ///< *.jpg (MJPEG) and *.yuv (YUYV), played in the order of their names.
};

/// A USB camera at one end of a socket whose other end is the kernel's virtual host controller.
class FakeCamera {
 public:
  /// Loads the frames and plugs the camera in. Throws std::runtime_error.
  explicit FakeCamera(const Options& options);

  [[nodiscard]] int socket() const { return socket_.get(); }
  [[nodiscard]] int timer() const { return timer_.get(); }
  /// Answers one message of the controller. False: the controller has closed the connection.
  [[nodiscard]] bool handle_message();
  /// One frame time has passed.
  void handle_timer();
  void toggle_freeze();
  /// Unplugs, and returns once the controller has closed the connection. The last call.
  void unplug();
  void drift() { controls_.drift(); }
  [[nodiscard]] unsigned sent() const { return sent_; }
  /// Frame times at which the host had not yet taken the frame before.
  [[nodiscard]] unsigned dropped() const { return dropped_; }

 private:
  using Bytes = std::vector<std::uint8_t>;
  /// A transfer of the streaming endpoint that waits for data.
  struct Transfer {
    std::uint32_t sequence;
    std::size_t length;
    std::vector<usbip::IsoPacket> packets;
  };

  void load_frames();
  void plug_in();
  void answer_control(const usbip::Header& header, std::span<std::uint8_t> data);
  int standard_request(std::span<const std::uint8_t, 8> setup, std::span<std::uint8_t> data);
  int streaming_request(int request, bool commit, std::span<std::uint8_t> data);
  void unlink(const usbip::Header& header);
  void negotiate();
  void start();
  void stop();
  void pump(bool time_passed);
  std::size_t next_payload(std::uint8_t* to, std::size_t room);
  void reply(std::uint32_t sequence, int status, std::span<const std::uint8_t> data, int actual,
             std::span<const usbip::IsoPacket> packets);

  Options options_;
  Controls controls_;
  Bytes configuration_;
  std::array<std::vector<Bytes>, 2> frames_;  // MJPEG, YUYV
  dtact::base::UniqueFd socket_;
  dtact::base::UniqueFd timer_;
  std::array<std::uint8_t, 26> probe_{};  // the UVC probe/commit block
  std::deque<Transfer> waiting_;
  Bytes scratch_;
  bool streaming_ = false;
  bool frozen_ = false;
  bool broken_ = false;  // the socket is gone
  std::uint8_t frame_id_ = 0;
  unsigned played_ = 0;
  unsigned sent_ = 0;
  unsigned dropped_ = 0;
  bool flagged_ = false;                   // the frame under way carries the error bit
  std::span<const std::uint8_t> current_;  // the rest of the frame under way
};

}  // namespace uvcfake
