// uvcfake: a USB camera in user space. It speaks USB/IP over a socket pair into the kernel's own
// vhci-hcd, so that usbcore, uvcvideo and videobuf2 above it are real.
#include <poll.h>
#include <unistd.h>

#include <array>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <exception>

#include "tests/kernel/camera/uvcfake/fake_camera.hpp"

namespace {

constexpr const char* kUsage =
    "uvcfake [-i] [-f FPS] [-x N] [-e N] [-p PORT] [-n SERIAL]\n"
    "        [-r CONTROL] [-k CONTROL] [-l CONTROL] FOLDER\n"
    "plays FOLDER/*.jpg (MJPEG) or FOLDER/*.yuv (YUYV), sorted, in a loop\n"
    "  -i         isochronous endpoint, as most cameras have, instead of bulk\n"
    "  -f FPS     forces the rate (default: as negotiated)\n"
    "  -x N       every n-th frame is cut in half\n"
    "  -e N       every n-th frame carries the error bit\n"
    "  -r CONTROL refuses to be set\n"
    "  -k CONTROL keeps its value whatever it is set to\n"
    "  -l CONTROL the same, and lies about it\n"
    "  -p PORT    port of the virtual controller (0 to 7)\n"
    "  -n SERIAL  serial number (0001)\n"
    "SIGUSR1 freezes and resumes the stream, SIGUSR2 moves the gain, SIGTERM unplugs\n";

volatile std::sig_atomic_t g_quit = 0;
volatile std::sig_atomic_t g_toggle = 0;
volatile std::sig_atomic_t g_drift = 0;

void on_signal(int signal) {
  if (signal == SIGUSR1) {
    g_toggle = 1;
  } else if (signal == SIGUSR2) {
    g_drift = 1;
  } else {
    g_quit = 1;
  }
}

uvcfake::Options parse(int argc, char** argv) {
  uvcfake::Options options;
  for (int option = 0; (option = ::getopt(argc, argv, "if:x:e:r:k:l:p:n:")) > 0;) {
    switch (option) {
      case 'i':
        options.isochronous = true;
        break;
      case 'f':
        options.fps = std::atof(optarg);
        break;
      case 'x':
        options.cut_every = static_cast<unsigned>(std::atoi(optarg));
        break;
      case 'e':
        options.flag_every = static_cast<unsigned>(std::atoi(optarg));
        break;
      case 'r':
        options.faults.emplace_back(optarg, uvcfake::Fault::refuses);
        break;
      case 'k':
        options.faults.emplace_back(optarg, uvcfake::Fault::ignores);
        break;
      case 'l':
        options.faults.emplace_back(optarg, uvcfake::Fault::lies);
        break;
      case 'p':
        options.port = std::atoi(optarg);
        break;
      case 'n':
        options.serial = optarg;
        break;
      default:
        std::fputs(kUsage, stderr);
        std::exit(64);
    }
  }
  if (optind + 1 != argc) {
    std::fputs(kUsage, stderr);
    std::exit(64);
  }
  options.folder = argv[optind];
  return options;
}

}  // namespace

int main(int argc, char** argv) try {
  const uvcfake::Options options = parse(argc, argv);
  // Without SA_RESTART, so that a signal wakes poll().
  struct sigaction action{};
  action.sa_handler = on_signal;
  for (const int signal : {SIGUSR1, SIGUSR2, SIGTERM, SIGINT}) {
    ::sigaction(signal, &action, nullptr);
  }
  uvcfake::FakeCamera camera(options);
  std::array<pollfd, 2> fds{{{camera.socket(), POLLIN, 0}, {camera.timer(), POLLIN, 0}}};
  while (g_quit == 0) {
    const int ready = ::poll(fds.data(), fds.size(), -1);
    if (g_toggle != 0) {
      g_toggle = 0;
      camera.toggle_freeze();
    }
    if (g_drift != 0) {
      g_drift = 0;
      camera.drift();
    }
    if (ready <= 0) continue;
    if (fds[0].revents != 0 && !camera.handle_message()) break;
    if (fds[1].revents != 0) camera.handle_timer();
  }
  camera.unplug();
  std::fprintf(stderr, "uvcfake: unplugged, %u frames sent, %u dropped\n", camera.sent(),
               camera.dropped());
  return 0;
} catch (const std::exception& e) {
  std::fprintf(stderr, "uvcfake: %s\n", e.what());
  return 1;
}
