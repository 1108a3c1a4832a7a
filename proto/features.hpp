#pragma once

#include <array>

namespace dtact::wire {

/// What a daemon can do beyond version 1.0, as HelloReply.features lists it; proto/README.md says
/// what each stands for. A client asks for what is listed and does not compare versions.
inline constexpr std::array kFeatures = {
    "contact_absence", "decimation",     "events",    "force",  "jpeg",   "ping",
    "rates",           "reconstruction", "reference", "region", "stamps", "units",
};

/// The same of dtact-perceive.
inline constexpr std::array kPerceiveFeatures = {
    "cloud", "decimation", "events", "ping", "pose", "rates", "region",
};

}  // namespace dtact::wire
