// QEMU plugin: how often each instruction is executed between two addresses, for mix.py.
//   -plugin FILE,begin=HEX,end=HEX,skip=CALLS,out=FILE
// Writes the number of calls behind the first `skip`, then "address count" lines. Debian ships QEMU
// without its plugin header; what is used of it is declared here, version 1 of the interface.
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <string>
#include <string_view>

extern "C" {
using Id = std::uint64_t;
struct qemu_plugin_tb;
struct qemu_plugin_insn;
using Translated = void (*)(Id, qemu_plugin_tb*);
using Executed = void (*)(unsigned, void*);
using AtExit = void (*)(Id, void*);
void qemu_plugin_register_vcpu_tb_trans_cb(Id, Translated);
void qemu_plugin_register_vcpu_insn_exec_cb(qemu_plugin_insn*, Executed, int, void*);
void qemu_plugin_register_atexit_cb(Id, AtExit, void*);
std::size_t qemu_plugin_tb_n_insns(const qemu_plugin_tb*);
qemu_plugin_insn* qemu_plugin_tb_get_insn(const qemu_plugin_tb*, std::size_t);
std::uint64_t qemu_plugin_insn_vaddr(const qemu_plugin_insn*);

__attribute__((visibility("default"))) int qemu_plugin_version = 1;
}

namespace {

struct Instruction {
  std::uint64_t address;
  std::uint64_t count;
};

// Never destroyed: QEMU asks for the counts when the program's destructors have run.
auto& instructions = *new std::map<std::uint64_t, Instruction>;  // nodes stay where they are
auto& out = *new std::string;
std::uint64_t begin_address = 0;
std::uint64_t end_address = 0;
std::uint64_t skipped_calls = 0;
std::uint64_t calls = 0;
bool inside = false;

void execute(unsigned, void* data) {
  Instruction& instruction = *static_cast<Instruction*>(data);
  if (instruction.address == end_address) inside = false;
  if (!inside && instruction.address == begin_address) {
    inside = true;
    ++calls;
  }
  if (inside && calls > skipped_calls) ++instruction.count;
}

void translate(Id, qemu_plugin_tb* block) {
  for (std::size_t k = 0; k < qemu_plugin_tb_n_insns(block); ++k) {
    qemu_plugin_insn* const at = qemu_plugin_tb_get_insn(block, k);
    const std::uint64_t address = qemu_plugin_insn_vaddr(at);
    Instruction& instruction = instructions.try_emplace(address, address, 0U).first->second;
    qemu_plugin_register_vcpu_insn_exec_cb(at, execute, 0, &instruction);
  }
}

void write(Id, void*) {
  std::FILE* const file = std::fopen(out.c_str(), "w");
  if (file == nullptr) return;
  std::fprintf(file, "%llu\n",
               static_cast<unsigned long long>(calls > skipped_calls ? calls - skipped_calls : 0));
  for (const auto& [address, instruction] : instructions) {
    if (instruction.count == 0) continue;
    std::fprintf(file, "%llx %llu\n", static_cast<unsigned long long>(address),
                 static_cast<unsigned long long>(instruction.count));
  }
  std::fclose(file);
}

}  // namespace

extern "C" __attribute__((visibility("default"))) int qemu_plugin_install(Id id, const void*,
                                                                          int count,
                                                                          char** arguments) {
  for (int k = 0; k < count; ++k) {
    const std::string_view argument(arguments[k]);
    const std::string value(argument.substr(argument.find('=') + 1));
    if (argument.starts_with("begin=")) begin_address = std::stoull(value, nullptr, 16);
    if (argument.starts_with("end=")) end_address = std::stoull(value, nullptr, 16);
    if (argument.starts_with("skip=")) skipped_calls = std::stoull(value);
    if (argument.starts_with("out=")) out = value;
  }
  qemu_plugin_register_vcpu_tb_trans_cb(id, translate);
  qemu_plugin_register_atexit_cb(id, write, nullptr);
  return 0;
}
