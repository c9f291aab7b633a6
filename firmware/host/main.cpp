#include "firmware/host/commands/command.hpp"

int main(int argc, char** argv) { return cutforce::firmware::host::run_program(argc, argv); }
