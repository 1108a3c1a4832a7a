#pragma once

// The topics of a recording and the names of its attachments; README.md beside this file says what
// each holds.
namespace dtact::recording {

inline constexpr const char* kFrameTopic = "/dtact/frame";
inline constexpr const char* kEventTopic = "/dtact/event";
inline constexpr const char* kLightTopic = "/dtact/light";
inline constexpr const char* kStatusTopic = "/dtact/status";
inline constexpr const char* kDepthTopic = "/dtact/depth";
inline constexpr const char* kCameraTopic = "/camera/jpeg";
inline constexpr const char* kPointsTopic = "/dtact/points";
inline constexpr const char* kPoseTopic = "/dtact/pose";
inline constexpr const char* kRecognitionTopic = "/dtact/recognition";
inline constexpr const char* kTransformsTopic = "/tf";

inline constexpr const char* kCalibrationToml = "calibration.toml";
inline constexpr const char* kReferencePng = "reference.png";
/// What depth was measured against: 16-bit grey, grey level times 256.
inline constexpr const char* kCurrentReferencePng = "current_reference.png";

}  // namespace dtact::recording
