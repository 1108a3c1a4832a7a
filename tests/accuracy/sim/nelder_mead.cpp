#include "tests/accuracy/sim/nelder_mead.hpp"

#include <algorithm>

namespace dtact::accuracy {
namespace {

struct Vertex {
  std::vector<double> at;
  double cost = 0;
};

// from + t·(to − from)
std::vector<double> along(const std::vector<double>& from, const std::vector<double>& to,
                          double t) {
  std::vector<double> point(from.size());
  for (std::size_t i = 0; i < from.size(); ++i) point[i] = from[i] + t * (to[i] - from[i]);
  return point;
}

}  // namespace

std::vector<double> nelder_mead(const std::function<double(const std::vector<double>&)>& cost,
                                const std::vector<double>& start, const std::vector<double>& step,
                                int evaluations, double tolerance) {
  const std::size_t n = start.size();
  int left = evaluations;
  const auto vertex = [&](std::vector<double> at) {
    --left;
    const double value = cost(at);
    return Vertex{std::move(at), value};
  };
  std::vector<Vertex> simplex = {vertex(start)};
  for (std::size_t i = 0; i < n; ++i) {
    std::vector<double> at = start;
    at[i] += step[i];
    simplex.push_back(vertex(std::move(at)));
  }
  const auto cheaper = [](const Vertex& a, const Vertex& b) { return a.cost < b.cost; };
  while (left > 0) {
    std::sort(simplex.begin(), simplex.end(), cheaper);
    if (simplex.back().cost - simplex.front().cost < tolerance) break;
    std::vector<double> centre(n);
    for (std::size_t k = 0; k < n; ++k) {
      for (std::size_t i = 0; i < n; ++i) {
        centre[i] += simplex[k].at[i] / static_cast<double>(n);
      }
    }
    Vertex& worst = simplex.back();
    Vertex reflected = vertex(along(centre, worst.at, -1));
    if (reflected.cost < simplex.front().cost) {
      Vertex expanded = vertex(along(centre, worst.at, -2));
      worst = expanded.cost < reflected.cost ? std::move(expanded) : std::move(reflected);
    } else if (reflected.cost < simplex[n - 1].cost) {
      worst = std::move(reflected);
    } else {
      if (reflected.cost < worst.cost) worst = std::move(reflected);
      Vertex contracted = vertex(along(centre, worst.at, 0.5));
      if (contracted.cost < worst.cost) {
        worst = std::move(contracted);
      } else {
        for (std::size_t k = 1; k <= n; ++k) {
          simplex[k] = vertex(along(simplex.front().at, simplex[k].at, 0.5));
        }
      }
    }
  }
  return std::min_element(simplex.begin(), simplex.end(), cheaper)->at;
}

}  // namespace dtact::accuracy
