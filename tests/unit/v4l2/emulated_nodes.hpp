#pragma once

#include <umockdev.h>

#include <cstdint>
#include <deque>
#include <string>
#include <vector>

namespace dtact::hal::v4l2 {

/// A video node that reports its capabilities and does nothing else.
struct EmulatedNode {
  int number = 0;  ///< N of /dev/videoN.
  bool usb = false;
  std::uint32_t caps = 0;
  const char* name = "";  ///< Driver and card.
  const char* bus = "";
  bool has_input = false;
  std::uint32_t fourcc = 0;  ///< 0 = no format.
  std::uint32_t width = 0;   ///< 0 = every size from 64×48 to 16384×8192.
  std::uint32_t height = 0;
};

/// /dev/videoN for each of the nodes, emulated in this process by libumockdev.
class EmulatedNodes {
 public:
  explicit EmulatedNodes(const std::vector<EmulatedNode>& nodes);
  EmulatedNodes(const EmulatedNodes&) = delete;
  EmulatedNodes& operator=(const EmulatedNodes&) = delete;
  ~EmulatedNodes();

  /// A link below /dev to a node, as udev makes them.
  void link(const std::string& from, int number) const;

 private:
  struct Attached {
    EmulatedNode node;
    UMockdevIoctlBase* handler;
  };
  static gboolean on_ioctl(UMockdevIoctlBase* base, UMockdevIoctlClient* client, gpointer node);
  static int answer(const EmulatedNode& node, unsigned long request,
                    std::vector<std::uint8_t>& argument);

  UMockdevTestbed* testbed_;
  std::deque<Attached> attached_;  // not moved: the handlers point into it
};

}  // namespace dtact::hal::v4l2
