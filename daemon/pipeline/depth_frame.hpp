#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "daemon/pipeline/health.hpp"
#include "daemon/recon/force.hpp"
#include "daemon/recon/reconstructor.hpp"
#include "hal/frame.hpp"
#include "hal/light_ring.hpp"

namespace dtact::pipeline {

/// Nanoseconds of each stage of one frame.
struct StageTimes {
  std::int64_t decode_ns = 0;
  std::int64_t activity_ns = 0;  ///< The look for what changed.
  std::int64_t rectify_ns = 0;
  std::int64_t smooth_ns = 0;
  std::int64_t lut_ns = 0;
  std::int64_t inspect_ns = 0;  ///< The contact summary.
  std::int64_t publish_ns = 0;  ///< Copies of what subscribers want, until done_ns.
};

/// The contact, in the depth map's coordinates (origin at its centre, x right, y down).
struct ContactSummary {
  bool in_contact = false;
  double threshold_mm = 0;  ///< The contact threshold.
  double area_mm2 = 0;      ///< Area pressed deeper than it.
  double x_mm = 0;          ///< Depth-weighted centroid of that area.
  double y_mm = 0;
  double deepest_mm = 0;  ///< Greatest indentation.
  double deepest_x_mm = 0;
  double deepest_y_mm = 0;
  double volume_mm3 = 0;              ///< Indentation summed over the contact area.
  std::optional<recon::Force> force;  ///< Along the surface's normal; 0 N without contact.
  recon::ForceAbsence force_absence = recon::ForceAbsence::none;  ///< Why there is none.
};

/// Why a frame has no contact summary. The sensor may be in contact all the same.
enum class ContactAbsence : std::uint8_t {
  none,          ///< It was measured.
  uncalibrated,  ///< There is nothing to measure by.
  referencing,   ///< The light settles or the reference image is being taken.
  unasked        ///< Not requested when the frame was captured.
};

/// One frame's result, in buffers that are allocated once and used again.
struct DepthFrame {
  hal::FrameInfo camera;
  std::int64_t wall_ns = 0;  ///< CLOCK_REALTIME at camera.timestamp_ns, nanoseconds since 1970.
  std::int64_t done_ns = 0;  ///< CLOCK_MONOTONIC when the result was published.
  std::uint64_t number = 0;  ///< Number of the result since start, from 1, fetched or not.
  hal::Light light;          ///< What the ring showed when the frame was exposed.
  /// Frames whose timestamp is not before it are exposed under `light` alone; none: not known.
  std::optional<std::int64_t> light_since_ns;
  /// UseCalibration::key of what the frame was measured by; none: uncalibrated.
  std::optional<std::uint64_t> calibration;
  HealthSet health;
  StageTimes times;
  ContactAbsence contact_absence = ContactAbsence::none;
  ContactSummary contact;  ///< Empty unless measured.

  bool has_depth = false;
  int width = 0;  ///< Pixels of the depth map.
  int height = 0;
  double mm_per_px = 0;
  int decimation = 1;         ///< The map has 1/decimation of the calibration's resolution.
  int made_decimation = 1;    ///< It was made at 1/made_decimation of it, …
  int sharpen_steps = 0;      ///< … sharpened by this number of steps, and interpolated.
  recon::Surface surface;     ///< The surface that depth_um is measured from.
  double uncertainty_um = 0;  ///< Mean absolute error to expect inside the contact.
  int contact_um = 0;         ///< What is deeper belongs to the contact.
  std::vector<std::int16_t>
      depth_um;  ///< Row-major; recon::kUntrusted marks pixels not to believe.

  recon::DrawnTiles drawn;  ///< What depth_um holds, for the reconstruction.
  /// Calibration (ActiveCalibration) and its rung (Resolutions) that drew it.
  std::uint64_t drawn_generation = 0;
  std::size_t drawn_resolution = 0;

  bool has_luma = false;
  int luma_width = 0;  ///< Pixels of the camera frame.
  int luma_height = 0;
  std::vector<std::uint8_t> luma;  ///< Row-major, without padding.

  bool has_jpeg = false;
  int jpeg_width = 0;  ///< Pixels of the camera frame.
  int jpeg_height = 0;
  std::vector<std::uint8_t> jpeg;  ///< As received from the camera.
};

}  // namespace dtact::pipeline
