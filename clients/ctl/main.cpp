#include <iostream>

#include "clients/ctl/ctl.hpp"

int main(int argc, char** argv) {
  return dtact::ctl::run({argv + 1, argv + argc}, std::cout, std::cerr);
}
