#include "clients/calibrate/lens/chessboard.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>
#include <stdexcept>

namespace dtact::ctl {
namespace {

using Corners = std::vector<cv::Point2f>;

constexpr int kFixed =
    cv::CALIB_FIX_ASPECT_RATIO | cv::CALIB_ZERO_TANGENT_DIST | cv::CALIB_FIX_K3 | cv::CALIB_FIX_K2;
constexpr LensModel kBoardModels[] = {LensModel::radial1, LensModel::radial2, LensModel::radial3};

cv::Size inner(const Chessboard& board) { return {board.cols - 1, board.rows - 1}; }

Corners find_corners(const cv::Mat1b& image, const std::string& name, const Chessboard& board) {
  Corners corners;
  if (!cv::findChessboardCorners(image, inner(board), corners)) {
    throw std::runtime_error(fmt::format(
        "{}: no chessboard of {}x{} squares found; it must show whole, with a light border", name,
        board.cols, board.rows));
  }
  // Half the shortest distance of neighbours: no corner may reach into the next one's field.
  double shortest = image.cols;
  for (std::size_t i = 1; i < corners.size(); ++i) {
    shortest = std::min(shortest, cv::norm(corners[i] - corners[i - 1]));
  }
  const int half = std::clamp(static_cast<int>(shortest / 3), 2, 11);
  cv::cornerSubPix(image, corners, {half, half}, {-1, -1},
                   {cv::TermCriteria::COUNT + cv::TermCriteria::EPS, 50, 1e-3});
  // OpenCV may begin at a corner from which the board appears mirrored.
  const auto cols = inner(board).width;
  const cv::Point2f along = corners[1] - corners[0];
  const cv::Point2f down = corners[static_cast<std::size_t>(cols)] - corners[0];
  if (along.x * down.y - along.y * down.x < 0) {
    for (auto row = corners.begin(); row != corners.end(); row += cols) {
      std::reverse(row, row + cols);
    }
  }
  return corners;
}

std::vector<cv::Point3f> board_points(const Chessboard& board) {
  std::vector<cv::Point3f> points;
  const cv::Size size = inner(board);
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      points.emplace_back(static_cast<float>((x - 0.5 * (size.width - 1)) * board.square_mm),
                          static_cast<float>((y - 0.5 * (size.height - 1)) * board.square_mm), 0.F);
    }
  }
  return points;
}

struct Camera {
  cv::Matx33d matrix;
  cv::Vec<double, 5> distortion;
};

int flags_of(LensModel model) {
  int flags = kFixed;
  if (model >= LensModel::radial2) flags &= ~cv::CALIB_FIX_K2;
  if (model >= LensModel::radial3) flags &= ~cv::CALIB_FIX_K3;
  return flags;
}

Camera calibrate(const std::vector<Corners>& images, const std::vector<cv::Point3f>& points,
                 cv::Size frame, LensModel model) {
  const std::vector<std::vector<cv::Point3f>> boards(images.size(), points);
  Camera camera{cv::Matx33d::eye(), {}};
  std::vector<cv::Mat> rotations;
  std::vector<cv::Mat> translations;
  cv::calibrateCamera(boards, images, frame, camera.matrix, camera.distortion, rotations,
                      translations, flags_of(model));
  return camera;
}

/// The lens of a camera that looks at the board of `corners`.
recon::Lens lens_of(const Camera& camera, LensModel model, const Corners& corners,
                    const std::vector<cv::Point3f>& points) {
  cv::Vec3d rotation;
  cv::Vec3d translation;
  cv::solvePnP(points, corners, camera.matrix, camera.distortion, rotation, translation);
  cv::Matx33d r;
  cv::Rodrigues(rotation, r);
  const cv::Matx33d pose(r(0, 0), r(0, 1), translation[0], r(1, 0), r(1, 1), translation[1],
                         r(2, 0), r(2, 1), translation[2]);
  cv::Matx33d h = camera.matrix * pose;
  h = h * (1 / h(2, 2));
  recon::Lens lens;
  std::copy(std::begin(h.val), std::end(h.val), lens.homography.begin());
  lens.centre_col = camera.matrix(0, 2);
  lens.centre_row = camera.matrix(1, 2);
  lens.radius_px = camera.matrix(0, 0);
  const double terms[] = {camera.distortion[0], camera.distortion[1], camera.distortion[4]};
  lens.radial.assign(terms, terms + (static_cast<int>(model) - 1));
  return lens;
}

std::vector<Mark> marks_of(const Corners& corners, const std::vector<cv::Point3f>& points) {
  std::vector<Mark> marks;
  marks.reserve(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    marks.push_back({{points[i].x, points[i].y}, {corners[i].x, corners[i].y}});
  }
  return marks;
}

/// Mean squared residual of each image with the camera of all others, and the first one's
/// residuals.
struct LeftOutImages {
  std::vector<double> squares;
  std::vector<recon::Point> first;
};

LeftOutImages leave_images_out(const std::vector<Corners>& images,
                               const std::vector<cv::Point3f>& points, cv::Size frame,
                               LensModel model) {
  LeftOutImages result;
  for (std::size_t out = 0; out < images.size(); ++out) {
    std::vector<Corners> others = images;
    others.erase(others.begin() + static_cast<std::ptrdiff_t>(out));
    const Camera camera = calibrate(others, points, frame, model);
    const std::vector<Mark> marks = marks_of(images[out], points);
    std::vector<recon::Point> residuals =
        residuals_mm(lens_of(camera, model, images[out], points), marks);
    const double error = rms(residuals);
    result.squares.push_back(error * error);
    if (out == 0) result.first = std::move(residuals);
  }
  return result;
}

ChosenLens choose_camera(const std::vector<Corners>& images, const std::vector<cv::Point3f>& points,
                         cv::Size frame) {
  ChosenLens chosen;
  LeftOutImages best;
  for (const LensModel model : kBoardModels) {
    LeftOutImages left_out = leave_images_out(images, points, frame, model);
    chosen.left_out_rms_of_each.push_back(rms(left_out.first));
    if (best.squares.empty() || clearly_lower(left_out.squares, best.squares)) {
      chosen.model = model;
      best = std::move(left_out);
    }
  }
  chosen.left_out = std::move(best.first);
  chosen.lens =
      lens_of(calibrate(images, points, frame, chosen.model), chosen.model, images[0], points);
  chosen.in_sample = residuals_mm(chosen.lens, marks_of(images[0], points));
  return chosen;
}

}  // namespace

ChessboardLens calibrate_chessboards(const std::vector<cv::Mat1b>& images,
                                     const std::vector<std::string>& names,
                                     const Chessboard& board) {
  constexpr std::size_t kEnough = 4;  // images: three remain when one is left out
  if (board.cols < 4 || board.rows < 4 || !(board.square_mm > 0)) {
    throw std::runtime_error("chessboard: expected at least 4x4 squares with a size above 0 mm");
  }
  if (images.size() != 1 && images.size() < kEnough) {
    throw std::runtime_error(
        fmt::format("chessboard: {} images; give one that lies on the surface, or that one and at "
                    "least {} of the same board tilted",
                    images.size(), kEnough - 1));
  }
  const std::vector<cv::Point3f> points = board_points(board);
  std::vector<Corners> corners;
  corners.reserve(images.size());
  for (std::size_t i = 0; i < images.size(); ++i) {
    corners.push_back(find_corners(images[i], names[i], board));
  }
  ChessboardLens result;
  result.marks = marks_of(corners.front(), points);
  result.lens = images.size() == 1 ? choose_lens(result.marks)
                                   : choose_camera(corners, points, images.front().size());
  level(result.lens.lens, result.marks);
  return result;
}

}  // namespace dtact::ctl
