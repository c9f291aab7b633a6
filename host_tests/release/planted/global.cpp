// Refused by the symbol gate: a snapshot of a block's state would miss this one.
namespace cutforce::planted {
int next();
int next() {
  static int count = 0;
  return ++count;
}
}  // namespace cutforce::planted
