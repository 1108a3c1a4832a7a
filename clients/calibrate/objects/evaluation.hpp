#pragma once

#include <iosfwd>
#include <string>

namespace dtact::objects {

struct EvaluationPlan {
  std::string folder;
  std::string picture;   ///< Where the confusion table goes; empty: nowhere.
  double mm_per_px = 0;  ///< Of .npy files; 0: not given.
};

/// Says how well objects can be distinguished on a folder of presses: NAME/*.mcap (recordings, of
/// which each contact is a press) and NAME/*.npy (a press each); in NAME/OBJECT/ where several
/// objects have one name. Each frame is named after the nearest of the frames that are taught,
/// twice: with frames taken at random, as the DTact paper splits its images, and with none of the
/// same press or, where there are several, of the same object. Throws std::runtime_error naming the
/// file.
void evaluate(const EvaluationPlan& plan, std::ostream& out);

}  // namespace dtact::objects
