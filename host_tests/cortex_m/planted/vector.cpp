#include <vector>

extern "C" int planted(int value) {
  std::vector<int> values(3);
  values.push_back(value);
  return values.back();
}
