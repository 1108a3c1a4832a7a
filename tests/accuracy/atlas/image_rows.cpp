#include <algorithm>
#include <cmath>

#include "tests/accuracy/atlas/rows.hpp"
#include "tests/accuracy/atlas/scripts.hpp"

namespace dtact::atlas {
namespace {

void shift(Shot& shot, int /*n*/, double px) { shot.shift_px = px; }
void turn(Shot& shot, int /*n*/, double degrees) { shot.turn_deg = degrees; }

}  // namespace

std::vector<Row> image_rows() {
  return {
      {"image",
       "noise",
       "noise of a pixel",
       "times the nominal",
       {1, 2, 3, 4, 6, 8},
       on_ball([](Shot& shot, int, double noise) { shot.noise = noise; }),
       ""},
      {"image",
       "jpeg",
       "JPEG quality",
       "quality",
       {95, 90, 80, 60, 40, 20},
       on_ball([](Shot& shot, int, double q) { shot.jpeg = static_cast<int>(q); }),
       ""},
      {"image",
       "shift",
       "camera shifted while running",
       "pixels right and down",
       {0, 0.5, 1, 2, 3, 5, 10},
       after_move(shift, false),
       ""},
      {"image",
       "shift_rezero",
       "camera shifted, then re-zeroed",
       "pixels right and down",
       {0, 0.5, 1, 2, 3, 5, 10},
       after_move(shift, true),
       ""},
      {"image",
       "turn",
       "camera rotated while running",
       "degrees",
       {0, 0.25, 0.5, 1, 2, 3, 5},
       after_move(turn, false),
       ""},
      {"image",
       "turn_rezero",
       "camera rotated, then re-zeroed",
       "degrees",
       {0, 0.25, 0.5, 1, 2, 3, 5},
       after_move(turn, true),
       ""},
      {"image",
       "defocus",
       "defocus",
       "standard deviation, pixels",
       {0, 1, 2, 4, 8, 12},
       on_ball([](Shot& shot, int, double blur) { shot.blur_px = blur; }),
       "the gel blurs by itself, so a lens that blurs as much looks like a blunter object"},
      {"image",
       "dust",
       "specks of dust since the reference",
       "specks in the field",
       {0, 2, 5, 20, 50, 200},
       on_ball([](Shot& shot, int, double n) { shot.dust = static_cast<int>(n); }),
       ""},
      {"image",
       "dead_pixels",
       "dead pixels since the reference",
       "pixels",
       {0, 10, 100, 500, 2000, 10000},
       on_ball([](Shot& shot, int, double n) { shot.dead_pixels = static_cast<int>(n); }),
       ""},
      {"image",
       "frozen",
       "the camera repeats one picture while the object comes",
       "frames",
       {0, 2, 4, 8, 20},
       [](double frozen) {
         Script script = press(ball_truth(), frozen, {});
         const int from = kPress;
         script.frames = from + 24;
         script.judged = std::max(4, static_cast<int>(frozen));
         const int until = from + static_cast<int>(frozen);
         script.frames = frozen > 0 ? until : from + 24;
         script.shot = [=](int n) {
           Shot shot;
           if (n >= from) shot.moment = moment_of(0);
           if (n >= from && n < until) shot.stale_share = 1;
           return shot;
         };
         script.moment = [=](int n) { return n >= from ? moment_of(0) : 0; };
         script.judged = frozen > 0 ? static_cast<int>(frozen) : 12;
         return script;
       },
       ""},
      {"image",
       "torn",
       "a frame whose lower share is the one before, as the object comes",
       "share",
       {0, 0.1, 0.25, 0.5, 0.75},
       [](double share) {
         Script script = press(ball_truth(), share, {});
         script.frames = kPress + 1;
         script.judged = 1;
         script.shot = [share](int n) {
           Shot shot;
           if (n >= kPress) shot.moment = moment_of(0);
           if (n == kPress) shot.stale_share = share;
           return shot;
         };
         return script;
       },
       ""},
      {"image",
       "truncated",
       "payloads cut short",
       "share of the frames",
       {0, 0.1, 0.25, 0.5, 1},
       on_ball([](Shot& shot, int n, double share) {
         shot.damaged = std::fmod(n * share, 1.0) + share >= 1;
       }),
       ""},
  };
}

}  // namespace dtact::atlas
