#pragma once

#include <string>
#include <vector>

#include "clients/cpp/export.hpp"
#include "proto/dtact.pb.h"

namespace dtact::client {

/// STATE_SERVING → "serving"; a value of a newer daemon → "13".
DTACT_EXPORT [[nodiscard]] std::string name_of(v1::State state);
/// TIMESTAMP_FIRST_PACKET → "first_packet".
DTACT_EXPORT [[nodiscard]] std::string name_of(v1::TimestampMeaning meaning);
/// HEALTH_LIGHT_UNSETTLED → "light_unsettled".
DTACT_EXPORT [[nodiscard]] std::string name_of(v1::Health flag);
/// FORCE_ABSENCE_CUT_OFF → "cut_off".
DTACT_EXPORT [[nodiscard]] std::string name_of(v1::ForceAbsence absence);
/// The `health` of a frame, an event or the status.
DTACT_EXPORT [[nodiscard]] std::vector<std::string> names_of(
    const google::protobuf::RepeatedField<int>& health);

}  // namespace dtact::client
