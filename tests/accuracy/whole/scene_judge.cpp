#include "tests/accuracy/whole/scene_judge.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <memory>
#include <opencv2/imgproc.hpp>
#include <span>
#include <stdexcept>

#include "clients/perceive/frame_maker.hpp"
#include "daemon/calibration/calibration.hpp"
#include "proto/dtact.pb.h"

namespace dtact::whole {
namespace {

constexpr double kContactMm = pipeline::ContactRules{}.threshold_mm;
constexpr double kContactMm2 = pipeline::ContactRules{}.area_mm2;

/// Mean of absolute values; NaN without any.
class MeanError {
 public:
  void add(double error) {
    sum_ += std::abs(error);
    ++count_;
  }
  [[nodiscard]] double value() const { return count_ > 0 ? sum_ / count_ : NAN; }

 private:
  double sum_ = 0;
  int count_ = 0;
};

/// The truth at the pixels of the depth map.
struct TrueMap {
  cv::Mat1f indentation_mm;
  cv::Mat1b in_contact;
};

class TruthReader {
 public:
  TruthReader(const hal::sim::Truth& truth, const recon::RectifyTable& table)
      : truth_(truth),
        columns_(table.height, table.width),
        rows_(table.height, table.width),
        grid_values_(truth.grid().size()) {
    auto entry = table.entries.begin();
    for (int y = 0; y < table.height; ++y) {
      for (int x = 0; x < table.width; ++x, ++entry) {
        columns_(y, x) = static_cast<float>(entry->x + entry->fx / 128.0);
        rows_(y, x) = static_cast<float>(entry->y + entry->fy / 128.0);
      }
    }
  }

  TrueMap at(std::uint64_t sequence) {
    const hal::sim::CameraModel& camera = truth_.scene().camera;
    truth_.indentation_mm(sequence, indentation_);
    truth_.contact(sequence, contact_);
    const cv::Mat1f indentation(camera.height, camera.width, indentation_.data());
    const cv::Mat1b contact(camera.height, camera.width, contact_.data());
    TrueMap map;
    cv::remap(indentation, map.indentation_mm, columns_, rows_, cv::INTER_LINEAR);
    cv::remap(contact, map.in_contact, columns_, rows_, cv::INTER_NEAREST);
    truth_.blend(truth_.moment(sequence), grid_values_);
    return map;
  }

  /// The contact of the frame last read where it lies, as far as the map shows it.
  struct TrueContact {
    double area_mm2 = 0;
    double x_mm = 0;
    double y_mm = 0;
  };
  [[nodiscard]] TrueContact contact(double map_width_mm, double map_height_mm) const {
    const hal::sim::Grid& grid = truth_.grid();
    const double camera_mm = truth_.scene().surface.camera_mm;
    TrueContact contact;
    double weight = 0;
    std::size_t i = 0;
    for (int row = 0; row < grid.height; ++row) {
      for (int column = 0; column < grid.width; ++column, ++i) {
        const double depth = grid_values_[i] / static_cast<double>(hal::sim::Truth::kPerMm);
        const double x = grid.x0_mm + column * grid.spacing_mm;
        const double y = grid.y0_mm + row * grid.spacing_mm;
        const double rest = camera_mm > 0 ? 1 - depth / camera_mm : 1;
        if (depth <= kContactMm || 2 * std::abs(x) > rest * map_width_mm ||
            2 * std::abs(y) > rest * map_height_mm) {
          continue;
        }
        contact.area_mm2 += grid.spacing_mm * grid.spacing_mm;
        weight += depth;
        contact.x_mm += depth * x;
        contact.y_mm += depth * y;
      }
    }
    if (weight > 0) {
      contact.x_mm /= weight;
      contact.y_mm /= weight;
    }
    return contact;
  }

  /// Distance of a point from the true surface of the frame last read, mm, to first order.
  [[nodiscard]] double distance(double x_mm, double y_mm, double depth_mm) const {
    const hal::sim::Grid& grid = truth_.grid();
    const double column = (x_mm - grid.x0_mm) / grid.spacing_mm;
    const double row = (y_mm - grid.y0_mm) / grid.spacing_mm;
    const int x = std::clamp(static_cast<int>(column), 0, grid.width - 2);
    const int y = std::clamp(static_cast<int>(row), 0, grid.height - 2);
    const auto value = [&](int dx, int dy) {
      const auto index = static_cast<std::size_t>(y + dy) * static_cast<std::size_t>(grid.width) +
                         static_cast<std::size_t>(x + dx);
      return grid_values_[index] / static_cast<double>(hal::sim::Truth::kPerMm);
    };
    const double fx = column - x;
    const double fy = row - y;
    const double upper = std::lerp(value(0, 0), value(1, 0), fx);
    const double lower = std::lerp(value(0, 1), value(1, 1), fx);
    const double slope_x =
        std::lerp(value(1, 0) - value(0, 0), value(1, 1) - value(0, 1), fy) / grid.spacing_mm;
    const double slope_y = (lower - upper) / grid.spacing_mm;
    return std::abs(depth_mm - std::lerp(upper, lower, fy)) /
           std::sqrt(1 + slope_x * slope_x + slope_y * slope_y);
  }

 private:
  const hal::sim::Truth& truth_;
  cv::Mat1f columns_;
  cv::Mat1f rows_;
  std::vector<float> indentation_;
  std::vector<std::uint8_t> contact_;
  std::vector<std::int16_t> grid_values_;
};

v1::Frame parsed(const std::string& bytes) {
  v1::Frame frame;
  if (!frame.ParseFromString(bytes)) throw std::runtime_error("the frame cannot be parsed");
  return frame;
}

std::uint32_t bits_of(const v1::Frame& frame) {
  pipeline::HealthSet set;
  for (const int health : frame.health()) set.set(static_cast<pipeline::Health>(health - 1));
  return set.bits();
}

cv::Mat1s depth_of(const v1::DepthMap& map) {
  cv::Mat1s depth(static_cast<int>(map.height()), static_cast<int>(map.width()));
  if (map.data().size() != depth.total() * sizeof(std::int16_t)) {
    throw std::runtime_error("the depth map has another size than it says");
  }
  static_assert(std::endian::native == std::endian::little, "as the wire");
  std::memcpy(depth.data, map.data().data(), map.data().size());
  return depth;
}

void judge_depth(const v1::DepthMap& map, const cv::Mat1s& depth, const TrueMap& truth,
                 FrameErrors& out) {
  out.stated = 0.001 * map.uncertainty_um();
  cv::Mat1b near;
  const int reach = 2 * static_cast<int>(std::lround(kBesideMm / map.mm_per_px())) + 1;
  cv::dilate(truth.in_contact, near,
             cv::getStructuringElement(cv::MORPH_ELLIPSE, cv::Size(reach, reach)));
  MeanError inside;
  MeanError beside;
  MeanError away;
  int untrusted = 0;
  const int in_contact = cv::countNonZero(truth.in_contact);
  for (int y = 0; y < depth.rows; ++y) {
    for (int x = 0; x < depth.cols; ++x) {
      const bool contact = truth.in_contact(y, x) != 0;
      if (depth(y, x) == map.untrusted_value()) {
        untrusted += contact ? 1 : 0;
        continue;
      }
      const double error =
          0.001 * depth(y, x) * map.um_per_unit() - static_cast<double>(truth.indentation_mm(y, x));
      (contact ? inside : near(y, x) != 0 ? beside : away).add(error);
    }
  }
  out.inside = inside.value();
  out.beside = beside.value();
  out.away = away.value();
  if (in_contact > 0) out.untrusted = static_cast<double>(untrusted) / in_contact;
}

void judge_contact(const v1::Frame& frame, const TrueMap& truth, const TruthReader& reader,
                   double mm_per_px, FrameErrors& out) {
  const v1::Contact& contact = frame.contact();
  double deepest = 0;
  cv::minMaxLoc(truth.indentation_mm, nullptr, &deepest);
  out.true_deepest = std::max(out.true_deepest, deepest);
  const TruthReader::TrueContact is =
      reader.contact(truth.indentation_mm.cols * mm_per_px, truth.indentation_mm.rows * mm_per_px);
  out.true_area = is.area_mm2;
  out.in_contact = contact.in_contact();
  if (!out.in_contact || !out.pressed) return;
  if (out.true_area < kContactMm2) return;
  out.area = contact.area_mm2() / out.true_area - 1;
  out.centroid = std::hypot(contact.x_mm() - is.x_mm, contact.y_mm() - is.y_mm);
  out.deepest = contact.deepest_mm() - out.true_deepest;
  if (contact.has_force_n()) {
    out.force = contact.force_n() - out.true_force;
    out.stated_force = contact.force_uncertainty_n();
  }
}

void judge_points(const v1::PointCloud& cloud, const TruthReader& truth, FrameErrors& out) {
  const std::size_t size = static_cast<std::size_t>(cloud.width()) * cloud.height();
  std::vector<float> values(6 * size);
  if (cloud.data().size() != values.size() * sizeof(float)) {
    throw std::runtime_error("the points are not as many as they say");
  }
  std::memcpy(values.data(), cloud.data().data(), cloud.data().size());
  std::vector<double> distances;
  double sum = 0;
  for (std::size_t i = 0; i < size; ++i) {
    if (std::isnan(values[i])) continue;
    const auto mm = [&](std::size_t part) {
      return 1000 * cloud.metres_per_unit() * static_cast<double>(values[part * size + i]);
    };
    distances.push_back(truth.distance(mm(0), mm(1), -mm(2)));
    sum += distances.back();
  }
  if (distances.empty()) return;
  out.points = sum / static_cast<double>(distances.size());
  const auto at = distances.begin() + static_cast<std::ptrdiff_t>(distances.size() * 95 / 100);
  std::ranges::nth_element(distances, at);
  out.points_95 = *at;
}

/// Flags without a cause in the scene.
std::uint32_t without_cause(const RandomScene& scene, double true_deepest, double calibrated_mm) {
  using pipeline::Health;
  pipeline::HealthSet causes;
  causes.set(Health::not_realtime);     // does not concern depth
  causes.set(Health::image_saturated);  // a bulge in bright light is white
  causes.set(Health::light_drifted, scene.light == LightCase::led_fails);
  causes.set(Health::beyond_calibration, true_deepest > 0.9 * calibrated_mm - 0.03);
  return ~causes.bits();
}

bool is_beyond(const TrueMap& truth, double calibrated_mm) {
  return cv::countNonZero(truth.indentation_mm > 1.1 * calibrated_mm + 0.03) >
         2 * pipeline::PipelineConfig{}.beyond_pixels;
}

void keep_maps(const cv::Mat1s& depth, const TrueMap& truth, SceneReport& out) {
  out.map.clear();
  out.true_map.clear();
  out.map_width = (depth.cols + kMapStep - 1) / kMapStep;
  for (int y = 0; y < depth.rows; y += kMapStep) {
    for (int x = 0; x < depth.cols; x += kMapStep) {
      out.map.push_back(depth(y, x));
      out.true_map.push_back(
          static_cast<std::int16_t>(std::lround(1000 * truth.indentation_mm(y, x))));
    }
  }
}

}  // namespace

bool FrameErrors::is_flagged() const noexcept {
  pipeline::HealthSet harmless;
  harmless.set(pipeline::Health::not_realtime);
  harmless.set(pipeline::Health::beyond_calibration);
  return (health & ~harmless.bits()) != 0;
}

SceneReport judge(RandomScene scene, const std::filesystem::path& calibration) {
  const auto truth = solve_eased(scene);
  const auto model = calibration::load(calibration).model;
  SceneReport report;
  report.name = scene.name;
  report.what = scene.what;
  report.light = scene.light;
  report.thickness_mm = scene.scene.gel.thickness_mm;
  const recon::DepthLut& lut = model->lut;
  report.calibrated_mm =
      0.001 * lut.um.at(static_cast<std::size_t>(lut.covered_to_q6 - lut.first_q6));

  Settings settings;
  settings.seed = scene.seed;
  settings.lighting = scene.lighting;
  Program program(truth, calibration, settings);
  TruthReader reader(*truth, model->rectify);
  net::FrameKind points;
  points.cloud = v1::CLOUD_FLOAT32;
  points.contact_box = true;
  perceive::FrameMaker maker;
  std::uint32_t undue = 0;
  std::uint64_t n = 0;
  for (const JudgedFrame& judged : scene.judged) {
    for (; n <= judged.sequence; ++n) {
      const std::string frame = program.next();
      if (n < scene.judged.front().sequence) continue;
      ++report.watched;
      const std::uint32_t health = bits_of(parsed(frame));
      float deepest = 0;
      if (health != 0) {
        const TrueMap map = reader.at(n);
        deepest = static_cast<float>(*std::ranges::max_element(map.indentation_mm));
      }
      undue = without_cause(scene, static_cast<double>(deepest), report.calibrated_mm);
      for (std::size_t i = 0; i < report.flagged.size(); ++i) {
        report.flagged.at(i) += static_cast<int>(health >> i & 1U);
        report.false_alarms.at(i) += static_cast<int>((health & undue) >> i & 1U);
      }
    }
    const v1::Frame frame = parsed(program.as(whole_map_kind()));
    FrameErrors errors{.frame = judged};
    errors.health = bits_of(frame);
    const TrueMap map = reader.at(judged.sequence);
    errors.pressed = cv::countNonZero(map.in_contact) > 0;
    errors.true_force = truth->force_n(judged.sequence);
    if (frame.has_depth()) {
      const cv::Mat1s depth = depth_of(frame.depth());
      judge_depth(frame.depth(), depth, map, errors);
      judge_contact(frame, map, reader, frame.depth().mm_per_px(), errors);
      const double ratio = errors.pressed ? errors.inside_ratio() : errors.away / errors.stated;
      if (!errors.is_flagged() && ratio > report.worst_ratio) {
        report.worst_ratio = ratio;
        keep_maps(depth, map, report);
      }
      if (is_beyond(map, report.calibrated_mm)) {
        pipeline::HealthSet beyond;
        beyond.set(pipeline::Health::beyond_calibration);
        report.beyond_missed += (errors.health & beyond.bits()) == 0 ? 1 : 0;
      }
    }
    if (errors.in_contact && errors.pressed) {
      maker.begin(parsed(program.as(perceive_kind())), {});
      if (const auto made = maker.make(points)) {
        const v1::Frame cloud = parsed(made->body);
        if (cloud.has_cloud()) judge_points(cloud.cloud(), reader, errors);
      }
    }
    report.frames.push_back(errors);
  }
  return report;
}

}  // namespace dtact::whole
