// Refused by the symbol gate: asks the heap.
namespace cutforce::planted {
int* allocate();
int* allocate() { return new int(3); }
}  // namespace cutforce::planted
