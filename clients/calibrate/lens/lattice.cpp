#include "clients/calibrate/lens/lattice.hpp"

#include <algorithm>
#include <cmath>
#include <deque>
#include <functional>
#include <map>
#include <opencv2/imgproc.hpp>
#include <set>
#include <utility>

namespace dtact::ctl {
namespace {

using Node = std::pair<int, int>;  // column, row
using Net = std::map<Node, std::size_t>;

double cross(cv::Point2d a, cv::Point2d b) { return a.x * b.y - a.y * b.x; }

/// The two steps of the lattice about a node.
struct Steps {
  cv::Point2d along;
  cv::Point2d down;
};

/// Follows the lattice from one candidate with a first guess of its steps.
Net grow(const std::vector<Candidate>& candidates, std::size_t seed, const Steps& first) {
  // A prediction may err by this part of the step: neighbouring steps differ by a few per cent, and
  // half a step would reach points between two nodes.
  constexpr double kTolerance = 0.3;
  Net net{{{0, 0}, seed}};
  std::set<std::size_t> used{seed};
  std::map<Node, Steps> steps{{{0, 0}, first}};
  std::deque<Node> todo{{0, 0}};
  while (!todo.empty()) {
    const Node node = todo.front();
    todo.pop_front();
    const Steps here = steps.at(node);
    const cv::Point2d at = candidates[net.at(node)].px;
    for (const auto& [dx, dy] : {Node{1, 0}, Node{-1, 0}, Node{0, 1}, Node{0, -1}}) {
      const Node next{node.first + dx, node.second + dy};
      if (net.contains(next)) continue;
      const cv::Point2d expected = at + dx * here.along + dy * here.down;
      const auto nearest = std::ranges::min_element(
          candidates, {}, [&](const Candidate& c) { return cv::norm(c.px - expected); });
      const auto index = static_cast<std::size_t>(nearest - candidates.begin());
      const double reach = kTolerance * std::min(cv::norm(here.along), cv::norm(here.down));
      if (used.contains(index) || cv::norm(nearest->px - expected) > reach) continue;
      const cv::Point2d step = nearest->px - at;
      net.emplace(next, index);
      used.insert(index);
      steps.emplace(next, Steps{dx != 0 ? step * dx : here.along, dy != 0 ? step * dy : here.down});
      todo.push_back(next);
    }
  }
  return net;
}

/// The largest net over several seeds and first steps.
Net largest_net(const std::vector<Candidate>& candidates, std::size_t enough) {
  constexpr std::size_t kSeeds = 24;
  constexpr std::size_t kNeighbours = 8;
  Net best;
  for (std::size_t seed = 0; seed < std::min(kSeeds, candidates.size()); ++seed) {
    const cv::Point2d at = candidates[seed].px;
    std::vector<cv::Point2d> near;
    near.reserve(candidates.size());
    for (const Candidate& c : candidates) near.push_back(c.px - at);
    const std::size_t count = std::min(kNeighbours + 1, near.size());
    std::ranges::partial_sort(near, near.begin() + static_cast<std::ptrdiff_t>(count), {},
                              [](cv::Point2d p) { return cv::norm(p); });
    near.resize(count);
    for (const cv::Point2d along : near) {
      // Rows are the direction closer to level in the image.
      if (along.x <= 0 || along.x < std::abs(along.y)) continue;
      for (const cv::Point2d down : near) {
        const double across = cross(along, down);
        const double ratio = cv::norm(along) / cv::norm(down);
        if (!(across > 0.8 * cv::norm(along) * cv::norm(down)) || ratio < 0.6 || ratio > 1.67) {
          continue;
        }
        Net net = grow(candidates, seed, {along, down});
        if (net.size() > best.size()) best = std::move(net);
      }
    }
    if (best.size() >= enough) break;
  }
  return best;
}

}  // namespace

std::vector<Candidate> find_candidates(const cv::Mat1f& image, double sigma) {
  cv::Mat1f narrow;
  cv::Mat1f wide;
  cv::GaussianBlur(image, narrow, {}, sigma, sigma, cv::BORDER_REPLICATE);
  cv::GaussianBlur(image, wide, {}, 1.6 * sigma, 1.6 * sigma, cv::BORDER_REPLICATE);
  const cv::Mat1f band(narrow - wide);
  cv::Mat1f power;
  cv::GaussianBlur(band.mul(band), power, {}, 6 * sigma, 6 * sigma, cv::BORDER_REPLICATE);
  const int reach = 2 * static_cast<int>(std::lround(sigma)) + 1;
  cv::Mat1f highest;
  cv::dilate(band, highest, cv::getStructuringElement(cv::MORPH_ELLIPSE, {reach, reach}));
  std::vector<Candidate> candidates;
  for (int y = 0; y < band.rows; ++y) {
    for (int x = 0; x < band.cols; ++x) {
      const float value = band(y, x);
      if (!(value > 0) || value < highest(y, x)) continue;
      candidates.push_back({{static_cast<double>(x), static_cast<double>(y)},
                            value / (std::sqrt(power(y, x)) + 1e-12)});
    }
  }
  std::ranges::sort(candidates, std::greater<>{}, &Candidate::salience);
  return candidates;
}

std::vector<Lattice> find_lattices(const std::vector<Candidate>& candidates, int rows, int cols) {
  const int wanted = rows * cols;
  const Net net = largest_net(candidates, static_cast<std::size_t>(wanted));
  int left = 0;
  int right = 0;
  int top = 0;
  int bottom = 0;
  for (const auto& [node, index] : net) {
    left = std::min(left, node.first);
    right = std::max(right, node.first);
    top = std::min(top, node.second);
    bottom = std::max(bottom, node.second);
  }
  // The net may have grown into noise around the board, or the board may show in part.
  std::vector<Lattice> lattices;
  int fullest = wanted / 4;
  for (int y = std::min(top, bottom - rows + 1); y <= std::max(top, bottom - rows + 1); ++y) {
    for (int x = std::min(left, right - cols + 1); x <= std::max(left, right - cols + 1); ++x) {
      Lattice window{rows, cols, {}, 0};
      for (int row = 0; row < rows; ++row) {
        for (int col = 0; col < cols; ++col) {
          const auto node = net.find({x + col, y + row});
          window.places.emplace_back();
          if (node == net.end()) continue;
          window.places.back() = candidates[node->second].px;
          ++window.found;
        }
      }
      fullest = std::max(fullest, window.found);
      lattices.push_back(std::move(window));
    }
  }
  std::erase_if(lattices, [&](const Lattice& lattice) {
    return lattice.found < std::max(wanted / 4, fullest - std::max(rows, cols));
  });
  return lattices;
}

}  // namespace dtact::ctl
