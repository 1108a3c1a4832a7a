#include "tests/accuracy/atlas/scripts.hpp"

#include <utility>

namespace dtact::atlas {

Script press(std::shared_ptr<const hal::sim::Truth> truth, double value, const Spoil& spoil) {
  Script script;
  script.truth = std::move(truth);
  script.frames = kFrames;
  script.shot = [value, spoil](int n) {
    Shot shot;
    if (n >= kPress) shot.moment = moment_of(0);
    if (n >= kReady && spoil) spoil(shot, n, value);
    return shot;
  };
  return script;
}

std::function<Script(double)> on_ball(const Spoil& spoil, bool rezero) {
  return [spoil, rezero](double value) {
    Script script = press(ball_truth(), value, spoil);
    if (!rezero) return script;
    constexpr int kAgain = 40;  // frames for the new reference
    script.frames += kAgain;
    script.rezero = kReady + 6;
    script.shot = [value, spoil](int n) {
      Shot shot;
      if (n >= kPress + kAgain) shot.moment = moment_of(0);
      if (n >= kReady) spoil(shot, n, value);
      return shot;
    };
    return script;
  };
}

std::function<Script(double)> after_move(const Spoil& move, bool rezero) {
  return [move, rezero](double value) {
    if (rezero) return on_ball(move, true)(value);
    Script script = press(ball_truth(), value, move);
    constexpr int kSeconds = 60;  // a check of the marks and the pause before it
    script.fps = 1;
    script.frames += kSeconds;
    script.shot = [value, move](int n) {
      Shot shot;
      if (n >= kPress + kSeconds) shot.moment = moment_of(0);
      if (n >= kReady) move(shot, n, value);
      return shot;
    };
    return script;
  };
}

}  // namespace dtact::atlas
