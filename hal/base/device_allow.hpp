#pragma once

namespace dtact::base {

/// The fix for EPERM from a device's node: a file's mode answers EACCES, the device filter of a
/// systemd unit EPERM. The unit's DeviceAllow= stands for the numbers that devices had at its
/// start.
inline constexpr const char* kDeviceAllowFix =
    "the service's unit does not allow it: restart the unit, which then takes the device's present "
    "number, or name it in DeviceAllow= (systemctl edit)";

}  // namespace dtact::base
