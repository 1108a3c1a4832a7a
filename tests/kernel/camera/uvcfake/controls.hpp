#pragma once

#include <cstdint>
#include <optional>
#include <span>

namespace uvcfake {

/// The camera's photometric controls. It comes up as cameras do: everything automatic.
class Controls {
 public:
  /// `stubborn`: sharpness refuses to be set; gamma accepts every value and stays as it is.
  explicit Controls(bool stubborn) : stubborn_(stubborn) {}

  /// A class request to an entity's control (UVC 1.1, section 4.2): `request` is SET_CUR (1) or
  /// one of GET_CUR … GET_DEF (0x81 … 0x87); `data` is read or written. Returns the bytes of the
  /// answer; nothing = stall the endpoint.
  std::optional<int> handle(int entity, int selector, int request, std::span<std::uint8_t> data);
  /// The gain moves by 7 without having been asked, as under an automatic that won't be off.
  void drift();

 private:
  bool stubborn_;
};

}  // namespace uvcfake
