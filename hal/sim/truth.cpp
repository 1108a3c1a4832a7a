#include "hal/sim/truth.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>
#include <opencv2/core.hpp>
#include <optional>
#include <set>
#include <vector>

#include "hal/sim/elastic_layer.hpp"

namespace dtact::hal::sim {
namespace {

constexpr int kBlendBits = 15;

/// Rows blurred by a Gaussian and turned into columns; zero beyond the border.
cv::Mat1d blurred_across(const cv::Mat1d& map, double sigma) {
  const int reach = static_cast<int>(std::ceil(3 * sigma));
  std::vector<double> taps;
  double sum = 0;
  for (int i = -reach; i <= reach; ++i) {
    taps.push_back(std::exp(-0.5 * i * i / (sigma * sigma)));
    sum += taps.back();
  }
  cv::Mat1d out(map.cols, map.rows, 0.0);
  for (int row = 0; row < map.rows; ++row) {
    for (int column = 0; column < map.cols; ++column) {
      const int first = std::max(0, column - reach);
      const int last = std::min(map.cols - 1, column + reach);
      for (int k = first; k <= last; ++k) {
        const int tap = k - column + reach;
        out(column, row) += map(row, k) * taps[static_cast<std::size_t>(tap)] / sum;
      }
    }
  }
  return out;
}

double sample(const cv::Mat1d& map, double column, double row) {
  column = std::clamp(column, 0.0, map.cols - 1.001);
  row = std::clamp(row, 0.0, map.rows - 1.001);
  const int left = static_cast<int>(column);
  const int top = static_cast<int>(row);
  return std::lerp(std::lerp(map(top, left), map(top, left + 1), column - left),
                   std::lerp(map(top + 1, left), map(top + 1, left + 1), column - left), row - top);
}

/// The indentation after an object that sticks to the gel has dragged it along by (x_mm, y_mm).
/// In contact the map follows the object. Around it the sheared gel lags behind: there
/// the map is that of the object's old position, drawn towards the new one. The shear fades out
/// over about the gel thickness. `in_contact`: > 0 in contact. All are grid sized.
cv::Mat1d dragged(const cv::Mat1d& indentation_mm, const cv::Mat1d& in_contact, double x_mm,
                  double y_mm, double thickness_mm, const Grid& grid) {
  cv::Mat1d held(grid.height, grid.width);
  for (int row = 0; row < grid.height; ++row) {
    for (int column = 0; column < grid.width; ++column) {
      held(row, column) = in_contact(row, column) > 0 ? 1 : 0;
    }
  }
  const double sigma = thickness_mm / 2 / grid.spacing_mm;
  const cv::Mat1d near = blurred_across(blurred_across(held, sigma), sigma);
  cv::Mat1d out(grid.height, grid.width);
  for (int row = 0; row < grid.height; ++row) {
    for (int column = 0; column < grid.width; ++column) {
      // Half of what lies around the contact's edge is contact: there all of the drag arrives.
      const double behind = 1 - std::max(held(row, column), std::min(1.0, 2 * near(row, column)));
      out(row, column) = sample(indentation_mm, column + behind * x_mm / grid.spacing_mm,
                                row + behind * y_mm / grid.spacing_mm);
    }
  }
  return out;
}

// Where a press is at time t; nothing while its object is away or above the surface.
std::optional<PressKey> state_at(const Press& press, double t) {
  auto key = key_at(press, t);
  if (key && key->depth_mm <= 0) return std::nullopt;
  return key;
}

// The greatest movement of any point of an object in contact between two times, mm.
double movement(const Press& press, double t0, double t1) {
  const auto a = state_at(press, t0);
  const auto b = state_at(press, t1);
  if (!a && !b) return 0;
  if (!a || !b) return (a ? *a : *b).depth_mm;
  const double turn = (std::abs(b->rotation_deg - a->rotation_deg) +
                       std::hypot(b->tilt_x_deg - a->tilt_x_deg, b->tilt_y_deg - a->tilt_y_deg)) *
                      std::numbers::pi / 180;
  return std::max({std::hypot(b->x_mm - a->x_mm, b->y_mm - a->y_mm),
                   std::hypot(b->drag_x_mm - a->drag_x_mm, b->drag_y_mm - a->drag_y_mm),
                   std::abs(b->depth_mm - a->depth_mm), turn * press.object.reach_mm});
}

// Times at which the gel is solved.
std::vector<double> solve_times(const Scene& scene) {
  std::set<double> keys = {0};
  for (const Press& press : scene.presses) {
    for (const PressKey& key : press.keys) keys.insert(key.time_s);
  }
  std::vector<double> times;
  for (auto key = keys.begin(); key != keys.end(); ++key) {
    times.push_back(*key);
    if (std::next(key) == keys.end()) break;
    const double t0 = *key;
    const double t1 = *std::next(key);
    double farthest = 0;
    for (const Press& press : scene.presses) {
      farthest = std::max(farthest, movement(press, t0, t1));
    }
    // A little less than one step more is one step: 1.2 / 0.3 is not exactly 4.
    const int steps = static_cast<int>(std::ceil(farthest / scene.gel.solve_step_mm - 1e-6));
    for (int i = 1; i < steps; ++i) times.push_back(t0 + (t1 - t0) * i / steps);
  }
  return times;
}

}  // namespace

Truth::Truth(const Scene& scene)
    : scene_(scene), grid_(make_grid(scene)), pixels_(scene.camera, scene.surface, grid_) {
  solve_all();
}

void Truth::solve_all() {
  const ElasticLayer gel(grid_.width, grid_.height, grid_.spacing_mm, scene_.gel.thickness_mm,
                         scene_.gel.poisson);
  maps_.push_back(
      {std::vector<std::int16_t>(grid_.size()), std::vector<std::int16_t>(grid_.size()), 0});

  // A press and its release pass through the same states: each is solved once. Lengths in
  // nanometres, so that states which differ by rounding are one.
  using State = std::vector<std::array<long, 9>>;
  std::map<State, int> solved = {{{}, 0}};
  cv::Mat1d guess;
  for (const double time : solve_times(scene_)) {
    State state;
    cv::Mat1d target(grid_.height, grid_.width, -kNoSurface);
    double drag_x_mm = 0;
    double drag_y_mm = 0;
    for (std::size_t i = 0; i < scene_.presses.size(); ++i) {
      const auto at = state_at(scene_.presses[i], time);
      if (!at || at->depth_mm < 1e-6) continue;
      state.push_back({static_cast<long>(i), std::lround(at->x_mm * 1e6),
                       std::lround(at->y_mm * 1e6), std::lround(at->depth_mm * 1e6),
                       std::lround(at->rotation_deg * 1e6), std::lround(at->tilt_x_deg * 1e6),
                       std::lround(at->tilt_y_deg * 1e6), std::lround(at->drag_x_mm * 1e6),
                       std::lround(at->drag_y_mm * 1e6)});
      drag_x_mm += at->drag_x_mm;
      drag_y_mm += at->drag_y_mm;
      lower_object(scene_.surface, scene_.presses[i].object, *at, scene_.gel.thickness_mm, grid_,
                   target);
    }
    auto found = solved.find(state);
    if (found == solved.end()) {
      Pressed pressed = gel.solve(target, guess);
      guess = pressed.pressure;
      if (drag_x_mm != 0 || drag_y_mm != 0) {
        pressed.indentation_mm = dragged(pressed.indentation_mm, pressed.pressure, drag_x_mm,
                                         drag_y_mm, scene_.gel.thickness_mm, grid_);
      }
      Map map{std::vector<std::int16_t>(grid_.size()), std::vector<std::int16_t>(grid_.size()), 0};
      for (std::size_t i = 0; i < grid_.size(); ++i) {
        map.indentation[i] = static_cast<std::int16_t>(
            std::lround(pressed.indentation_mm.ptr<double>()[i] * kPerMm));
        map.contact[i] = pressed.pressure.ptr<double>()[i] > 0 ? 256 : 0;
      }
      map.force_n = cv::sum(pressed.pressure)[0] * scene_.gel.youngs_modulus_mpa *
                    grid_.spacing_mm * grid_.spacing_mm;  // 1 MPa = 1 N/mm²
      found = solved.emplace(state, static_cast<int>(maps_.size())).first;
      maps_.push_back(std::move(map));
    }
    instants_.push_back({time, found->second});
  }
}

Truth::Moment Truth::moment(std::uint64_t sequence) const noexcept {
  const double t = scene_.time_s(sequence);
  const auto next = std::upper_bound(instants_.begin(), instants_.end(), t,
                                     [](double time, const Instant& i) { return time < i.time_s; });
  const Instant& a = *std::prev(next);  // the first instant is at 0
  if (next == instants_.end() || next->map == a.map) return {a.map, a.map, 0};
  const double w = (t - a.time_s) / (next->time_s - a.time_s);
  const int weight = std::min(static_cast<int>(w * (1 << kBlendBits)), (1 << kBlendBits) - 1);
  return {a.map, next->map, weight};
}

void Truth::blend(const Moment& moment, std::span<std::int16_t> out) const noexcept {
  const std::int16_t* const a = maps_[static_cast<std::size_t>(moment.from)].indentation.data();
  const std::int16_t* const b = maps_[static_cast<std::size_t>(moment.to)].indentation.data();
  const std::int32_t weight = moment.weight;
  for (std::size_t i = 0; i < out.size(); ++i) {
    const std::int32_t change = (b[i] - a[i]) * weight + (1 << (kBlendBits - 1));
    out[i] = static_cast<std::int16_t>(a[i] + (change >> kBlendBits));
  }
}

/// Calls `each` with the value that every pixel of the camera sees, row by row; clears `out`
/// before.
template <typename Each, typename Out>
void Truth::see(std::span<const std::int16_t> indentation, std::span<const std::int16_t> values,
                const Each& each, Out& out) const {
  Perspective perspective(scene_.surface, grid_);
  perspective.follow(indentation, kPerMm);
  std::vector<std::int16_t> seen(grid_.size());
  perspective.read(values, seen);
  std::vector<std::int16_t> row(static_cast<std::size_t>(scene_.camera.width));
  out.clear();
  out.reserve(row.size() * static_cast<std::size_t>(scene_.camera.height));
  for (int y = 0; y < scene_.camera.height; ++y) {
    pixels_.sample_row(y, seen, row);
    std::ranges::for_each(row, each);
  }
}

void Truth::indentation_mm(std::uint64_t sequence, std::vector<float>& out) const {
  std::vector<std::int16_t> map(grid_.size());
  blend(moment(sequence), map);
  see(map, map, [&out](std::int16_t v) { out.push_back(static_cast<float>(v) / kPerMm); }, out);
}

void Truth::contact(std::uint64_t sequence, std::vector<std::uint8_t>& out) const {
  const Moment at = moment(sequence);
  const int nearer = at.weight < (1 << (kBlendBits - 1)) ? at.from : at.to;
  std::vector<std::int16_t> map(grid_.size());
  blend(at, map);
  see(
      map, maps_[static_cast<std::size_t>(nearer)].contact,
      [&out](std::int16_t v) { out.push_back(v >= 128 ? 255 : 0); }, out);
}

std::optional<Pose> Truth::pose(std::size_t press, std::uint64_t sequence) const {
  const Press& wanted = scene_.presses.at(press);
  const auto key = key_at(wanted, scene_.time_s(sequence));
  if (!key) return std::nullopt;
  return pose_of(scene_.surface, wanted.object, *key);
}

SurfacePoint Truth::surface_at(double column, double row) const {
  return point_at(scene_.surface,
                  unrolled(scene_.surface, pixel_place(scene_.camera, column, row)));
}

double Truth::force_n(std::uint64_t sequence) const noexcept {
  const Moment at = moment(sequence);
  return std::lerp(maps_[static_cast<std::size_t>(at.from)].force_n,
                   maps_[static_cast<std::size_t>(at.to)].force_n,
                   static_cast<double>(at.weight) / (1 << kBlendBits));
}

}  // namespace dtact::hal::sim
