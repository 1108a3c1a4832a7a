#include "clients/calibrate/lens/pins.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <iterator>
#include <numeric>
#include <opencv2/imgproc.hpp>
#include <stdexcept>
#include <utility>

#include "clients/calibrate/lens/lattice.hpp"
#include "clients/calibrate/lens/pin_fit.hpp"

namespace dtact::ctl {
namespace {

using recon::Lens;
using recon::Point;

/// Standard deviation of the pixel noise: from the median absolute response of the 3×3 filter that
/// is blind to planes and edges (Immerkær 1996); the pins hardly affect it.
double noise_of(const cv::Mat1f& image) {
  const cv::Matx33f filter(1, -2, 1, -2, 4, -2, 1, -2, 1);  // norm 6
  cv::Mat1f response;
  cv::filter2D(image, response, CV_32F, filter);
  std::vector<float> sizes;
  for (const float value : response) sizes.push_back(std::abs(value));
  const auto middle = sizes.begin() + static_cast<std::ptrdiff_t>(sizes.size() / 2);
  std::ranges::nth_element(sizes, middle);
  return 1.4826 * *middle / 6;
}

/// What the pins are looked for in.
struct Darkening {
  cv::Mat1f levels;  ///< Grey levels of the mean light, as if the light were even.
  cv::Mat1f noise;   ///< Standard deviation of each pixel's level: large where the light is weak.
};

Darkening relative_darkening(const cv::Mat1f& reference, const cv::Mat1f& frame) {
  constexpr double kSmooth = 3;      // pixels: the light is smooth, the camera's noise is not
  constexpr double kDarkest = 0.05;  // of the mean; darker parts are ignored
  cv::Mat1f light;
  cv::GaussianBlur(reference, light, {}, kSmooth, kSmooth, cv::BORDER_REPLICATE);
  const double mean = cv::mean(light)[0];
  const cv::Mat1f gain(mean / cv::max(light, kDarkest * mean));
  const cv::Mat1f loss(reference - frame);
  return {cv::Mat1f(loss.mul(gain)), cv::Mat1f(noise_of(loss) * gain)};
}

/// At the pixel nearest to a place, or at the frame's edge nearest to it.
float at_nearest(const cv::Mat1f& image, Point px) {
  return image(std::clamp(static_cast<int>(std::lround(px.y)), 0, image.rows - 1),
               std::clamp(static_cast<int>(std::lround(px.x)), 0, image.cols - 1));
}

Point place_mm(const Board& board, const Lattice& lattice, int row, int col) {
  return {(col - 0.5 * (lattice.cols - 1)) * board.pitch_mm,
          (row - 0.5 * (lattice.rows - 1)) * board.pitch_mm};
}

[[noreturn]] void refuse(const std::vector<std::string>& missing, int pins) {
  throw std::runtime_error(fmt::format(
      "board: {} of {} pins not found: {} (rows and columns counted from the image's upper left "
      "corner); press the board in more evenly, or give the number of pins that the picture shows",
      missing.size(), pins, fmt::join(missing, "; ")));
}

/// The model of the first search: robust against a few bad points.
LensModel searching_model(std::size_t marks) {
  return marks >= 24 ? LensModel::radial1 : LensModel::affine;
}

/// A lattice refined in the image: the pins found and those missing.
struct Settled {
  const Lattice* lattice = nullptr;
  std::vector<Mark> marks;
  std::vector<std::string> missing;
  Lens lens;          ///< Of 12 parameters, through the marks; only if has_lens().
  double rms_mm = 0;  ///< Their residual for it.

  [[nodiscard]] bool has_lens() const {
    return marks.size() >= static_cast<std::size_t>(parameters(LensModel::radial2));
  }
};

/// The median of the heights around a place of the lattice.
double neighbours_height(const std::vector<double>& heights, const Lattice& lattice, int row,
                         int col) {
  std::vector<double> around;
  for (int y = std::max(0, row - 1); y <= std::min(lattice.rows - 1, row + 1); ++y) {
    for (int x = std::max(0, col - 1); x <= std::min(lattice.cols - 1, col + 1); ++x) {
      if (x == col && y == row) continue;
      around.push_back(
          heights[static_cast<std::size_t>(y) * static_cast<std::size_t>(lattice.cols) +
                  static_cast<std::size_t>(x)]);
    }
  }
  std::ranges::sort(around);
  return around[around.size() / 2];
}

/// Row or column of a mark by its millimetres.
int index_of(double mm, int count, const Board& board) {
  return static_cast<int>(std::lround(mm / board.pitch_mm + 0.5 * (count - 1)));
}

std::string name_of(int row, int col) { return fmt::format("row {}, column {}", row + 1, col + 1); }

/// Drops points far off the lens through all pins: they are something else,
/// such as the rim of a leak. Returns whether it dropped any.
bool drop_strays(Settled& settled, const Lens& lens, const Board& board) {
  constexpr double kFar = 6;  // medians of the distances; seven standard deviations if normal
  std::vector<double> distances;
  for (const Point& r : residuals_mm(lens, settled.marks)) {
    distances.push_back(std::hypot(r.x, r.y));
  }
  std::vector<double> sorted = distances;
  std::ranges::sort(sorted);
  const double limit = kFar * sorted[sorted.size() / 2];
  std::vector<Mark> kept;
  for (std::size_t i = 0; i < distances.size(); ++i) {
    const Mark& mark = settled.marks[i];
    if (distances[i] <= limit) {
      kept.push_back(mark);
    } else {
      settled.missing.push_back(name_of(index_of(mark.mm.y, settled.lattice->rows, board),
                                        index_of(mark.mm.x, settled.lattice->cols, board)));
    }
  }
  const bool any = kept.size() < settled.marks.size();
  settled.marks = std::move(kept);
  return any;
}

constexpr double kSure = 5;          // standard deviations of the noise
constexpr double kWithin = 0.25;     // of the pitch
constexpr double kNeighbours = 0.2;  // of the neighbours' height

/// Height that noise alone makes at a place.
double height_noise(const Darkening& image, const PinFit& fit, const Lens& lens, Point mm) {
  return fit.height_noise(at_nearest(image.noise, project(lens, mm)));
}

/// Throws FitFailed where no lens goes through the lattice's pins.
Settled settle(const Darkening& image, const Lattice& lattice, const Board& board) {
  constexpr int kRounds = 3;
  Settled settled{&lattice, {}, {}, {}, 0};
  int i = 0;
  for (const auto& place : lattice.places) {
    if (place) {
      settled.marks.push_back(
          {place_mm(board, lattice, i / lattice.cols, i % lattice.cols), {place->x, place->y}});
    }
    ++i;
  }
  Lens lens = fit_lens(settled.marks, searching_model(settled.marks.size()));
  for (int round = 0; round < kRounds; ++round) {
    const PinFit fit(image.levels, board.pitch_mm, recon::central_mm_per_px(lens));
    std::vector<Point> places;
    std::vector<double> heights;
    for (int pin = 0; pin < lattice.rows * lattice.cols; ++pin) {
      const auto peak =
          fit.find(lens, place_mm(board, lattice, pin / lattice.cols, pin % lattice.cols),
                   kWithin * board.pitch_mm);
      places.push_back(peak ? peak->mm : Point{});
      heights.push_back(peak ? peak->height : 0);
    }
    settled.marks.clear();
    settled.missing.clear();
    for (int pin = 0; pin < lattice.rows * lattice.cols; ++pin) {
      const int row = pin / lattice.cols;
      const int col = pin % lattice.cols;
      const double height = heights[static_cast<std::size_t>(pin)];
      if (height > kSure * height_noise(image, fit, lens, place_mm(board, lattice, row, col)) &&
          height > kNeighbours * neighbours_height(heights, lattice, row, col)) {
        settled.marks.push_back({place_mm(board, lattice, row, col),
                                 project(lens, places[static_cast<std::size_t>(pin)])});
      } else {
        settled.missing.push_back(name_of(row, col));
      }
    }
    if (2 * settled.missing.size() > lattice.places.size() || !settled.has_lens()) return settled;
    lens = fit_lens(settled.marks, LensModel::radial2);
    if (!drop_strays(settled, lens, board)) continue;
    if (!settled.has_lens()) return settled;
    lens = fit_lens(settled.marks, LensModel::radial2);
  }
  settled.lens = lens;
  settled.rms_mm = rms(residuals_mm(lens, settled.marks));
  return settled;
}

/// Throws where what was taken for pins lies between brighter spots that are narrower. Pins are
/// narrow: in the square between four of them the mean darkening lies above the median.
void refuse_exchanged(const Darkening& image, const Settled& settled, const Board& board) {
  constexpr int kSamples = 12;  // along a side
  const Lattice& lattice = *settled.lattice;
  double sum = 0;
  for (int row = 0; row + 1 < lattice.rows; ++row) {
    for (int col = 0; col + 1 < lattice.cols; ++col) {
      const Point corner = place_mm(board, lattice, row, col);
      std::vector<double> levels;
      for (int y = 0; y < kSamples; ++y) {
        for (int x = 0; x < kSamples; ++x) {
          const Point mm{corner.x + board.pitch_mm * (x + 0.5) / kSamples,
                         corner.y + board.pitch_mm * (y + 0.5) / kSamples};
          levels.push_back(at_nearest(image.levels, project(settled.lens, mm)));
        }
      }
      const double mean =
          std::accumulate(levels.begin(), levels.end(), 0.0) / static_cast<double>(levels.size());
      std::ranges::sort(levels);
      sum += mean - levels[levels.size() / 2];
    }
  }
  if (sum >= 0) return;
  throw std::runtime_error(
      "board: the pins are brighter than their surroundings: the undeformed surface and the "
      "pressed board are exchanged");
}

/// A board's outer line on one side, and what lies one line further out.
struct Side {
  const char* where;  ///< "left", ...
  std::string line;   ///< "column 1", ...
  int pins = 0;       ///< Pins of the line.
  int found = 0;      ///< Pins found.
  int beyond = 0;     ///< Peaks that would count as pins one line further out.
};

Side side_of(const Darkening& image, const Settled& settled, const Board& board, bool rows,
             bool last) {
  const Lattice& lattice = *settled.lattice;
  const int count = rows ? lattice.rows : lattice.cols;
  const int outer = last ? count - 1 : 0;
  Side side{rows ? (last ? "bottom" : "top") : (last ? "right" : "left"),
            fmt::format("{} {}", rows ? "row" : "column", outer + 1),
            rows ? lattice.cols : lattice.rows, 0, 0};
  for (const Mark& mark : settled.marks) {
    side.found += static_cast<int>(index_of(rows ? mark.mm.y : mark.mm.x, count, board) == outer);
  }
  const PinFit fit(image.levels, board.pitch_mm, recon::central_mm_per_px(settled.lens));
  std::vector<double> heights;
  for (const Mark& mark : settled.marks) {
    const auto peak = fit.find(settled.lens, mark.mm, kWithin * board.pitch_mm);
    heights.push_back(peak ? peak->height : 0);
  }
  std::ranges::sort(heights);
  const double usual = heights[heights.size() / 2];
  for (int i = 0; i < side.pins; ++i) {
    const int further = last ? count : -1;
    const Point mm = place_mm(board, lattice, rows ? further : i, rows ? i : further);
    const Point px = project(settled.lens, mm);
    // Beyond the edge the image repeats its last row, in which a bend of the light passes for a
    // pin.
    if (px.x < 0 || px.y < 0 || px.x > image.levels.cols - 1 || px.y > image.levels.rows - 1) {
      continue;
    }
    const auto peak = fit.find(settled.lens, mm, kWithin * board.pitch_mm);
    side.beyond +=
        static_cast<int>(peak && peak->height > kNeighbours * usual &&
                         peak->height > kSure * height_noise(image, fit, settled.lens, mm));
  }
  return side;
}

/// Throws where the lattice could as well lie one line further to a side: by that it would lose
/// its outer line on the other side, which then has to show clearly more pins than it would gain.
void refuse_shifted(const Darkening& image, const Settled& settled, const Board& board) {
  for (const bool rows : {false, true}) {
    const Side first = side_of(image, settled, board, rows, false);
    const Side last = side_of(image, settled, board, rows, true);
    for (const auto& [lost, gained] : {std::pair{&first, &last}, {&last, &first}}) {
      if (2 * (lost->found - gained->beyond) >= lost->pins) continue;
      throw std::runtime_error(fmt::format(
          "board: the lattice of {}x{} pins may lie one {} off: at the {} {} of {} pins of {} are "
          "found, at the {} {} beyond {}; light both sides and press the board in evenly, or give "
          "the number of pins that the picture shows",
          board.rows, board.cols, rows ? "row" : "column", lost->where, lost->found, lost->pins,
          lost->line, gained->where, gained->beyond, gained->line));
    }
  }
}

/// Whether two lattices have the same points, found at other scales.
bool same_places(const Lattice& a, const Lattice& b, double apart) {
  if (a.rows != b.rows) return false;
  for (std::size_t i = 0; i < a.places.size(); ++i) {
    const auto& here = a.places[i];
    const auto& there = b.places[i];
    if (here && there && cv::norm(*here - *there) > apart) return false;
  }
  return true;
}

/// All lattices at several scales, with the board upright and on edge.
std::vector<Lattice> lattices_of(const cv::Mat1f& image, const Board& board) {
  // Shares of the image's shorter side: from pins a few pixels wide to a board twice as large as
  // the frame.
  constexpr double kScales[] = {1 / 160., 1 / 120., 1 / 80., 1 / 60., 1 / 48., 1 / 36., 1 / 24.};
  std::vector<Lattice> all;
  for (const double scale : kScales) {
    const double sigma = scale * std::min(image.rows, image.cols);
    if (sigma < 1) continue;
    const std::vector<Candidate> candidates = find_candidates(image, sigma);
    for (const auto& [rows, cols] : {std::pair{board.rows, board.cols}, {board.cols, board.rows}}) {
      std::ranges::move(find_lattices(candidates, rows, cols), std::back_inserter(all));
      if (board.rows == board.cols) break;
    }
  }
  // The fullest first; of those with the same points one is enough.
  std::ranges::stable_sort(all, std::greater<>{}, &Lattice::found);
  const double apart = 0.25 * std::min(image.rows, image.cols) / std::max(board.rows, board.cols);
  std::vector<Lattice> distinct;
  for (Lattice& lattice : all) {
    if (std::ranges::none_of(
            distinct, [&](const Lattice& other) { return same_places(lattice, other, apart); })) {
      distinct.push_back(std::move(lattice));
    }
  }
  return distinct;
}

}  // namespace

PinPress find_pins(const cv::Mat1f& reference, const cv::Mat1f& frame, const Board& board) {
  const int fewest = parameters(LensModel::radial2);
  if (board.rows * board.cols < fewest) {
    throw std::runtime_error(
        fmt::format("board: {}x{} pins are too few for a lens: at least {} are needed", board.rows,
                    board.cols, fewest));
  }
  constexpr std::size_t kTries = 30;
  constexpr int kMayMiss = 10;  // one in ten: a lattice that is a row off misses more
  const Darkening image = relative_darkening(reference, frame);
  std::vector<Lattice> lattices = lattices_of(image.levels, board);
  lattices.resize(std::min(lattices.size(), kTries));
  Settled best;
  for (const Lattice& lattice : lattices) {
    Settled settled;
    try {
      settled = settle(image, lattice, board);
    } catch (const FitFailed&) {
      continue;  // too few of its pins were found, or they lie on a line; another may be the board
    }
    // The most pins; among windows and scales with equally many the most regular one.
    const bool better =
        best.lattice == nullptr || settled.missing.size() < best.missing.size() ||
        (settled.missing.size() == best.missing.size() && settled.rms_mm < best.rms_mm);
    if (better) best = std::move(settled);
  }
  if (best.lattice == nullptr || 2 * best.missing.size() > best.lattice->places.size()) {
    throw std::runtime_error(
        fmt::format("board: no lattice of {}x{} pins found; check that the images are an "
                    "undeformed surface and "
                    "the same with the board pressed in, and the numbers of rows and columns",
                    board.rows, board.cols));
  }
  if (!best.has_lens()) refuse(best.missing, board.rows * board.cols);
  refuse_exchanged(image, best, board);
  refuse_shifted(image, best, board);
  const int pins = board.rows * board.cols;
  if (kMayMiss * static_cast<int>(best.missing.size()) > pins) refuse(best.missing, pins);
  PinPress press{
      best.lattice->rows, best.lattice->cols, std::move(best.marks), std::move(best.missing), {}};
  press.lens = choose_lens(press.marks);
  level(press.lens.lens, press.marks);
  return press;
}

}  // namespace dtact::ctl
