#include <iostream>

#include "clients/calibrate/calibrate.hpp"

int main(int argc, char** argv) {
  return dtact::calibrate::run({argv + 1, argv + argc}, std::cout, std::cerr);
}
