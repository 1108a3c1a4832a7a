#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>

namespace uvcfake {

/// A control's fault in place of obeying.
enum class Fault {
  none,
  refuses,  ///< SET_CUR stalls.
  ignores,  ///< Accepts every value, keeps the old one, and reports the old one.
  lies      ///< Accepts every value, keeps the old one, and reports the new one.
};

/// The camera's photometric controls. Like those of most cameras, all start automatic.
class Controls {
 public:
  /// `name` as in the table of controls.cpp. Throws std::runtime_error, with all names, for
  /// another.
  void set_fault(const std::string& name, Fault fault);

  /// A class request to an entity's control (UVC 1.1, section 4.2): `request` is SET_CUR (1) or
  /// one of GET_CUR … GET_DEF (0x81 … 0x87); `data` is read or written. Returns the bytes of the
  /// answer; nothing = stall the endpoint.
  std::optional<int> handle(int entity, int selector, int request, std::span<std::uint8_t> data);
  /// The gain moves by 7 without a request, as under an automatic that can't be switched off.
  void drift();
};

}  // namespace uvcfake
