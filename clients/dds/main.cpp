#include <iostream>

#include "clients/dds/dds.hpp"

int main(int argc, char** argv) {
  return dtact::dds::run({argv + 1, argv + argc}, std::cout, std::cerr);
}
