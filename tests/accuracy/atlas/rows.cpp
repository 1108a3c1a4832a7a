#include "tests/accuracy/atlas/rows.hpp"

#include <cstddef>

#include "tests/accuracy/atlas/scenes.hpp"

namespace dtact::atlas {

std::vector<Row> rows() {
  std::vector<Row> all;
  for (auto part : {light_rows(), image_rows(), scene_rows(), reference_rows()}) {
    all.insert(all.end(), part.begin(), part.end());
  }
  return all;
}

std::vector<Script> clean_scripts() {
  const auto truth = solve({{hal::sim::ball(5), 2, -1, 1.0},
                            {hal::sim::m4_nut(), -4, 2, 0.9},
                            {hal::sim::cylinder(3, 10), 3, -3, 0.8},
                            {hal::sim::ball(4), -6, -6, 0.4},
                            {hal::sim::disc(4), 1, 1, 0.5},
                            {hal::sim::ball_array(1, 3, 4, 4), 0, 0, 0.6}});
  std::vector<Script> scripts;
  for (const int jpeg : {0, 90}) {
    Script script;
    script.truth = truth;
    script.frames = kReady + 12 * 40;
    script.judged = script.frames - kReady;
    script.shot = [jpeg](int n) {
      Shot shot;
      shot.jpeg = jpeg;
      const int turn = (n - kReady) / 40;
      if (n >= kReady && turn % 2 == 1) {
        shot.moment = moment_of(static_cast<std::size_t>(turn / 2) % 6);
      }
      return shot;
    };
    scripts.push_back(script);
  }
  return scripts;
}

}  // namespace dtact::atlas
