#include "tests/unit/v4l2/emulated_nodes.hpp"

#include <fmt/format.h>
#include <linux/videodev2.h>

#include <cerrno>
#include <filesystem>
#include <stdexcept>

#include "tests/unit/v4l2/ioctl_argument.hpp"

namespace dtact::hal::v4l2 {
namespace {

std::string node_name(int number) { return fmt::format("/dev/video{}", number); }

std::string description(const EmulatedNode& node) {
  const std::string parent =
      fmt::format("/devices/{}/device{}", node.usb ? "usb" : "platform", node.number);
  return fmt::format(
      "P: {0}/video4linux/video{1}\nN: video{1}=00\nE: DEVNAME=/dev/video{1}\n"
      "E: SUBSYSTEM=video4linux\nA: dev=81:{1}\\n\nL: device=../../../device{1}\n\n"
      "P: {0}\nE: SUBSYSTEM={2}\n{3}",
      parent, node.number, node.usb ? "usb" : "platform", node.usb ? "A: idVendor=1d6b\\n\n" : "");
}

}  // namespace

EmulatedNodes::EmulatedNodes(const std::vector<EmulatedNode>& nodes)
    : testbed_(umockdev_testbed_new()) {
  for (const EmulatedNode& node : nodes) {
    Attached& added = attached_.emplace_back(node, umockdev_ioctl_base_new());
    GError* error = nullptr;
    umockdev_testbed_add_from_string(testbed_, description(node).c_str(), &error);
    if (error != nullptr) throw std::runtime_error(error->message);
    g_signal_connect(added.handler, "handle-ioctl", G_CALLBACK(&EmulatedNodes::on_ioctl),
                     &added.node);
    umockdev_testbed_attach_ioctl(testbed_, node_name(node.number).c_str(), added.handler, &error);
    if (error != nullptr) throw std::runtime_error(error->message);
  }
}

EmulatedNodes::~EmulatedNodes() {
  for (const Attached& attached : attached_) {
    umockdev_testbed_detach_ioctl(testbed_, node_name(attached.node.number).c_str(), nullptr);
    g_object_unref(attached.handler);
  }
  g_object_unref(testbed_);
}

void EmulatedNodes::link(const std::string& from, int number) const {
  gchar* root = umockdev_testbed_get_root_dir(testbed_);
  const std::filesystem::path path = root + from;
  const std::filesystem::path node = root + node_name(number);
  g_free(root);
  std::filesystem::create_directories(path.parent_path());
  std::filesystem::create_symlink(node.lexically_relative(path.parent_path()), path);
}

gboolean EmulatedNodes::on_ioctl(UMockdevIoctlBase* /*base*/, UMockdevIoctlClient* client,
                                 gpointer node) {
  const unsigned long request = umockdev_ioctl_client_get_request(client);
  UMockdevIoctlData* pointer = umockdev_ioctl_client_get_arg(client);
  const std::size_t size = _IOC_SIZE(request);
  UMockdevIoctlData* data = umockdev_ioctl_data_resolve(pointer, 0, size, nullptr);
  std::vector<std::uint8_t> argument(data->data, data->data + size);
  const int error = answer(*static_cast<const EmulatedNode*>(node), request, argument);
  if (error == 0) umockdev_ioctl_data_update(data, 0, argument.data(), static_cast<gint>(size));
  umockdev_ioctl_data_unref(data);
  umockdev_ioctl_client_complete(client, error == 0 ? 0 : -1, error);
  return TRUE;
}

int EmulatedNodes::answer(const EmulatedNode& node, unsigned long request,
                          std::vector<std::uint8_t>& argument) {
  switch (request) {
    case VIDIOC_QUERYCAP: {
      auto& capability = as<v4l2_capability>(argument);
      put_text(capability.driver, node.name);
      put_text(capability.card, node.name);
      put_text(capability.bus_info, node.bus);
      capability.device_caps = node.caps;
      capability.capabilities = node.caps | V4L2_CAP_DEVICE_CAPS;
      return 0;
    }
    case VIDIOC_ENUMINPUT:
      if (!node.has_input) return ENOTTY;
      return as<v4l2_input>(argument).index == 0 ? 0 : EINVAL;
    case VIDIOC_ENUM_FMT: {
      auto& format = as<v4l2_fmtdesc>(argument);
      format.pixelformat = node.fourcc;
      return format.index == 0 && node.fourcc != 0 ? 0 : EINVAL;
    }
    case VIDIOC_ENUM_FRAMESIZES: {
      auto& size = as<v4l2_frmsizeenum>(argument);
      if (node.width == 0) {
        size.type = V4L2_FRMSIZE_TYPE_STEPWISE;
        size.stepwise = {64, 16384, 2, 48, 8192, 2};
      } else {
        size.type = V4L2_FRMSIZE_TYPE_DISCRETE;
        size.discrete = {node.width, node.height};
      }
      return size.index == 0 ? 0 : EINVAL;
    }
    default:
      return ENOTTY;
  }
}

}  // namespace dtact::hal::v4l2
