#include "tests/accuracy/sim/profile_plot.hpp"

#include <fmt/format.h>

#include <iterator>

namespace dtact::accuracy {
namespace {

constexpr double kWidth = 440;  // of a panel
constexpr double kLeft = 64;    // of the axes within it
constexpr double kPlot = 350;   // width of the axes
constexpr double kTop = 52;
constexpr double kTall = 250;  // height of the upper axes
constexpr double kGap = 26;
constexpr double kLow = 70;  // height of the lower axes

// A pair of axes on the page: 0–9 mm across, from `top` grey levels down to `bottom`.
struct Axes {
  double x0, y0, height, bottom, top;

  [[nodiscard]] double x(double mm) const { return x0 + mm / 9 * kPlot; }
  [[nodiscard]] double y(double grey) const { return y0 + (top - grey) / (top - bottom) * height; }
};

void draw_axes(std::string& svg, const Axes& axes, double step, bool numbers_below) {
  auto out = std::back_inserter(svg);
  const int lines = static_cast<int>((axes.top - axes.bottom) / step);
  for (int i = 0; i <= lines; ++i) {
    const double grey = axes.bottom + i * step;
    fmt::format_to(out,
                   R"(<line x1="{:.1f}" y1="{:.1f}" x2="{:.1f}" y2="{:.1f}" stroke="{}"/>)"
                   R"(<text x="{:.1f}" y="{:.1f}" text-anchor="end">{:.0f}</text>)"
                   "\n",
                   axes.x(0), axes.y(grey), axes.x(9), axes.y(grey), grey == 0 ? "#888" : "#e4e4e4",
                   axes.x(0) - 7, axes.y(grey) + 4, grey);
  }
  for (int mm = 0; mm <= 9; ++mm) {
    fmt::format_to(out,
                   R"(<line x1="{0:.1f}" y1="{1:.1f}" x2="{0:.1f}" y2="{2:.1f}" stroke="#e4e4e4"/>)"
                   "\n",
                   axes.x(mm), axes.y0, axes.y0 + axes.height);
    if (numbers_below) {
      fmt::format_to(out,
                     R"(<text x="{:.1f}" y="{:.1f}" text-anchor="middle">{}</text>)"
                     "\n",
                     axes.x(mm), axes.y0 + axes.height + 16, mm);
    }
  }
}

void draw_line(std::string& svg, const Axes& axes, const std::vector<double>& values,
               const char* colour) {
  auto out = std::back_inserter(svg);
  fmt::format_to(out, R"(<polyline fill="none" stroke="{}" stroke-width="2" points=")", colour);
  for (std::size_t i = 0; i < values.size(); ++i) {
    fmt::format_to(out, "{:.1f},{:.1f} ", axes.x(Profile::radius_mm(i)), axes.y(values[i]));
  }
  svg += "\"/>\n";
}

void draw_panel(std::string& svg, const ProfilePanel& panel, double left) {
  const Axes upper{left + kLeft, kTop, kTall, -30, 70};
  const Axes lower{left + kLeft, kTop + kTall + kGap, kLow, -2, 2};
  draw_axes(svg, upper, 10, false);
  draw_axes(svg, lower, 1, true);
  auto out = std::back_inserter(svg);
  fmt::format_to(out,
                 R"(<text x="{:.1f}" y="24" font-size="15" font-weight="bold">{}</text>)"
                 R"(<text x="{:.1f}" y="42">difference {:.2f} grey levels RMS</text>)"
                 "\n",
                 upper.x(0), panel.title, upper.x(0), rms_difference(panel.real, panel.simulated));
  draw_line(svg, upper, panel.simulated.change, "#d1495b");
  std::vector<double> rest;
  for (std::size_t i = 0; i < panel.real.change.size(); ++i) {
    fmt::format_to(out,
                   R"(<circle cx="{:.1f}" cy="{:.1f}" r="2.6" fill="#1d3557"/>)"
                   "\n",
                   upper.x(Profile::radius_mm(i)), upper.y(panel.real.change[i]));
    rest.push_back(panel.simulated.change[i] - panel.real.change[i]);
  }
  draw_line(svg, lower, rest, "#d1495b");
  fmt::format_to(out,
                 R"(<circle cx="{0:.1f}" cy="72" r="2.6" fill="#1d3557"/>)"
                 R"(<text x="{1:.1f}" y="76">real images (mean of 10)</text>)"
                 R"(<line x1="{2:.1f}" y1="92" x2="{3:.1f}" y2="92" stroke="#d1495b" )"
                 R"(stroke-width="2"/><text x="{1:.1f}" y="96">simulated sensor, fitted</text>)"
                 R"(<text x="{4:.1f}" y="{5:.1f}" text-anchor="middle">)"
                 "radius about the press's centroid, mm</text>\n",
                 upper.x(5) - 4, upper.x(5) + 10, upper.x(5) - 12, upper.x(5) + 4, upper.x(4.5),
                 lower.y0 + lower.height + 36);
  const auto label = [&](const Axes& axes, const char* text) {
    const double y = axes.y0 + axes.height / 2;
    fmt::format_to(out,
                   R"svg(<text transform="translate({:.1f},{:.1f}) rotate(-90)" )svg"
                   R"svg(text-anchor="middle">{}</text>)svg"
                   "\n",
                   left + 22, y, text);
  };
  label(upper, "darkening, grey levels");
  label(lower, "sim − real");
}

}  // namespace

std::string profile_svg(const std::vector<ProfilePanel>& panels) {
  const double width = kWidth * static_cast<double>(panels.size());
  const double height = kTop + kTall + kGap + kLow + 48;
  std::string svg = fmt::format(
      R"(<svg xmlns="http://www.w3.org/2000/svg" width="{0:.0f}" height="{1:.0f}" )"
      R"(viewBox="0 0 {0:.0f} {1:.0f}" font-family="sans-serif" font-size="12" fill="#222">)"
      "\n"
      R"(<rect width="{0:.0f}" height="{1:.0f}" fill="white"/>)"
      "\n",
      width, height);
  for (std::size_t i = 0; i < panels.size(); ++i) {
    draw_panel(svg, panels[i], static_cast<double>(i) * kWidth);
  }
  return svg + "</svg>\n";
}

}  // namespace dtact::accuracy
