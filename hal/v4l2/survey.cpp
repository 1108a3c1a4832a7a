#include "hal/v4l2/survey.hpp"

#include <utility>

#include "hal/v4l2/node.hpp"

namespace dtact::hal::v4l2 {

std::vector<SurveyedCamera> survey_cameras() {
  std::vector<SurveyedCamera> cameras;
  for (Attached& attached : list_nodes()) {
    SurveyedCamera camera;
    if (attached.problem.empty() && attached.not_taken.empty()) {
      try {
        const DeviceName::Opened opened = DeviceName(attached.node).open();
        camera.modes = list_modes(opened.fd.get());
        camera.controls = list_controls(opened.fd.get());
      } catch (const DeviceError& e) {
        attached.problem = e.what();
      }
    }
    camera.attached = std::move(attached);
    cameras.push_back(std::move(camera));
  }
  return cameras;
}

}  // namespace dtact::hal::v4l2
