// The part of libgpiod 2.x that gpio_lines_v2.cpp and peer_lines_v2.cpp call, over one imaginary
// chip. Its declarations are those of the real header, so a call with wrong types does not compile.
#include "libgpiod_v2/stand_in.hpp"

#include <gpiod.h>

#include <algorithm>
#include <cerrno>

using cutforce::host_tests::stand_in;

namespace cutforce::host_tests {
StandIn stand_in;
}  // namespace cutforce::host_tests

struct gpiod_chip {};
struct gpiod_chip_info {};
struct gpiod_line_info {
  unsigned offset;
};
struct gpiod_line_settings {
  bool output = false;
  bool active_low = false;
  int level = 0;
  gpiod_line_edge edge = GPIOD_LINE_EDGE_NONE;
};
struct gpiod_line_config {
  std::vector<std::pair<unsigned, gpiod_line_settings>> lines;
};
struct gpiod_request_config {
  std::string consumer;
};
struct gpiod_line_request {};
struct gpiod_edge_event {
  cutforce::host_tests::StandIn::Edge edge;
};
struct gpiod_edge_event_buffer {
  size_t capacity = 0;
  std::vector<gpiod_edge_event> events;
};

namespace {

template <class T>
T* give(T value = {}) {
  ++stand_in.alive_objects;
  return new T(value);
}
template <class T>
void take_back(T* object) {
  --stand_in.alive_objects;
  delete object;
}

}  // namespace

extern "C" {

gpiod_chip* gpiod_chip_open(const char* /*path*/) { return give<gpiod_chip>(); }
void gpiod_chip_close(gpiod_chip* chip) { take_back(chip); }
gpiod_chip_info* gpiod_chip_get_info(gpiod_chip* /*chip*/) { return give<gpiod_chip_info>(); }
void gpiod_chip_info_free(gpiod_chip_info* info) { take_back(info); }
const char* gpiod_chip_info_get_name(gpiod_chip_info* /*info*/) { return "gpiochip0"; }
const char* gpiod_chip_info_get_label(gpiod_chip_info* /*info*/) { return "stand-in"; }
size_t gpiod_chip_info_get_num_lines(gpiod_chip_info* /*info*/) {
  return cutforce::host_tests::StandIn::kLines;
}

gpiod_line_info* gpiod_chip_get_line_info(gpiod_chip* /*chip*/, unsigned int offset) {
  return give(gpiod_line_info{offset});
}
void gpiod_line_info_free(gpiod_line_info* info) { take_back(info); }
bool gpiod_line_info_is_used(gpiod_line_info* info) {
  return static_cast<int>(info->offset) == stand_in.busy_line;
}
const char* gpiod_line_info_get_name(gpiod_line_info* /*info*/) { return nullptr; }
const char* gpiod_line_info_get_consumer(gpiod_line_info* /*info*/) { return "spi0 CS0"; }

gpiod_line_settings* gpiod_line_settings_new() { return give<gpiod_line_settings>(); }
void gpiod_line_settings_free(gpiod_line_settings* settings) { take_back(settings); }
int gpiod_line_settings_set_direction(gpiod_line_settings* settings,
                                      gpiod_line_direction direction) {
  settings->output = direction == GPIOD_LINE_DIRECTION_OUTPUT;
  return 0;
}
void gpiod_line_settings_set_active_low(gpiod_line_settings* settings, bool active_low) {
  settings->active_low = active_low;
}
int gpiod_line_settings_set_output_value(gpiod_line_settings* settings, gpiod_line_value value) {
  settings->level = value == GPIOD_LINE_VALUE_ACTIVE ? 1 : 0;
  return 0;
}

int gpiod_line_settings_set_edge_detection(gpiod_line_settings* settings, gpiod_line_edge edge) {
  settings->edge = edge;
  return 0;
}

gpiod_line_config* gpiod_line_config_new() { return give<gpiod_line_config>(); }
void gpiod_line_config_free(gpiod_line_config* config) { take_back(config); }
int gpiod_line_config_add_line_settings(gpiod_line_config* config, const unsigned int* offsets,
                                        size_t count, gpiod_line_settings* settings) {
  for (size_t i = 0; i < count; ++i) config->lines.emplace_back(offsets[i], *settings);
  return 0;
}
gpiod_request_config* gpiod_request_config_new() { return give<gpiod_request_config>(); }
void gpiod_request_config_free(gpiod_request_config* config) { take_back(config); }
void gpiod_request_config_set_consumer(gpiod_request_config* config, const char* consumer) {
  config->consumer = consumer;
}

gpiod_line_request* gpiod_chip_request_lines(gpiod_chip* /*chip*/, gpiod_request_config* how,
                                             gpiod_line_config* config) {
  for (const auto& [offset, settings] : config->lines) {
    if (static_cast<int>(offset) == stand_in.busy_line) {
      errno = EBUSY;
      return nullptr;
    }
  }
  for (const auto& [offset, settings] : config->lines) {
    if (stand_in.no_edges && settings.edge != GPIOD_LINE_EDGE_NONE) {
      errno = ENXIO;
      return nullptr;
    }
  }
  stand_in.consumer = how->consumer;
  for (const auto& [offset, settings] : config->lines) {
    stand_in.requested.at(offset) = true;
    stand_in.output.at(offset) = settings.output;
    stand_in.active_low.at(offset) = settings.active_low;
    stand_in.edges.at(offset) = settings.edge;
    if (settings.output) stand_in.level.at(offset) = settings.level;
  }
  return give<gpiod_line_request>();
}
void gpiod_line_request_release(gpiod_line_request* request) {
  stand_in.requested = {};
  take_back(request);
}

int gpiod_line_request_set_value(gpiod_line_request* /*request*/, unsigned int offset,
                                 gpiod_line_value value) {
  if (stand_in.refuse || !stand_in.requested.at(offset) || !stand_in.output.at(offset)) return -1;
  const int level = value == GPIOD_LINE_VALUE_ACTIVE ? 1 : 0;
  if (stand_in.level.at(offset) != level) stand_in.changes.emplace_back(offset, level);
  stand_in.level.at(offset) = level;
  return 0;
}
int gpiod_line_request_set_values_subset(gpiod_line_request* request, size_t count,
                                         const unsigned int* offsets,
                                         const gpiod_line_value* values) {
  for (size_t i = 0; i < count; ++i) {
    if (gpiod_line_request_set_value(request, offsets[i], values[i]) != 0) return -1;
  }
  return 0;
}
gpiod_line_value gpiod_line_request_get_value(gpiod_line_request* /*request*/,
                                              unsigned int offset) {
  if (stand_in.refuse || !stand_in.requested.at(offset)) return GPIOD_LINE_VALUE_ERROR;
  return stand_in.level.at(offset) != 0 ? GPIOD_LINE_VALUE_ACTIVE : GPIOD_LINE_VALUE_INACTIVE;
}
int gpiod_line_request_get_values_subset(gpiod_line_request* request, size_t count,
                                         const unsigned int* offsets, gpiod_line_value* values) {
  for (size_t i = 0; i < count; ++i) {
    values[i] = gpiod_line_request_get_value(request, offsets[i]);
    if (values[i] == GPIOD_LINE_VALUE_ERROR) return -1;
  }
  return 0;
}

gpiod_edge_event_buffer* gpiod_edge_event_buffer_new(size_t capacity) {
  return give(gpiod_edge_event_buffer{capacity, {}});
}
void gpiod_edge_event_buffer_free(gpiod_edge_event_buffer* buffer) { take_back(buffer); }
int gpiod_line_request_wait_edge_events(gpiod_line_request* /*request*/, int64_t timeout_ns) {
  if (stand_in.refuse || timeout_ns != 0) return -1;  // the only caller must not wait
  return stand_in.queue.empty() ? 0 : 1;
}
int gpiod_line_request_read_edge_events(gpiod_line_request* /*request*/,
                                        gpiod_edge_event_buffer* buffer, size_t most) {
  buffer->events.clear();
  while (!stand_in.queue.empty() && buffer->events.size() < std::min(most, buffer->capacity)) {
    buffer->events.push_back({stand_in.queue.front()});
    stand_in.queue.pop_front();
  }
  return static_cast<int>(buffer->events.size());
}
gpiod_edge_event* gpiod_edge_event_buffer_get_event(gpiod_edge_event_buffer* buffer,
                                                    unsigned long index) {
  return &buffer->events.at(index);
}
unsigned int gpiod_edge_event_get_line_offset(gpiod_edge_event* event) {
  return event->edge.offset;
}
gpiod_edge_event_type gpiod_edge_event_get_event_type(gpiod_edge_event* event) {
  return event->edge.rising ? GPIOD_EDGE_EVENT_RISING_EDGE : GPIOD_EDGE_EVENT_FALLING_EDGE;
}
uint64_t gpiod_edge_event_get_timestamp_ns(gpiod_edge_event* event) { return event->edge.time_ns; }

}  // extern "C"
