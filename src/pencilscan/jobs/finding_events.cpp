#include "pencilscan/jobs/finding_events.h"

#include <map>
#include <string>
#include <utility>

namespace pencilscan {
namespace {

constexpr std::size_t kFramesBetween = 15;

/// A frame that says it: its number among those that are done, and the words.
struct Said {
  std::size_t number = 0;
  const FindingRow* finding = nullptr;
};

/// The words without the name of the frame, which the event has.
std::string text_of(const FindingRow& finding, const std::string& frame) {
  const std::string words = " in frame " + frame;
  std::string text = finding.text;
  if (const auto at = text.find(words); at != std::string::npos) text.erase(at, words.size());
  return text;
}

/// `said`: in order, of one run; `row`: of each frame that is done.
SequenceEvent event_of_run(std::span<const FrameRow> rows, std::span<const Said> said,
                           std::span<const std::size_t> row) {
  const std::size_t first = said.front().number;
  const std::size_t last = said.back().number;
  const FindingRow& finding = *said.front().finding;
  SequenceEvent event;
  event.first = row[first];
  event.last = row[last];
  event.lasts = last + 1 == row.size();
  event.kind = finding.code;
  event.device = finding.device;
  event.text = text_of(finding, rows[event.first].name);
  const std::size_t frames = last - first + 1;
  if (said.size() < frames) {
    event.text +=
        " (in " + std::to_string(said.size()) + " of these " + std::to_string(frames) + " frames)";
  }
  return event;
}

}  // namespace

std::vector<SequenceEvent> finding_events(std::span<const FrameRow> rows) {
  std::vector<std::size_t> done;
  std::map<std::pair<std::string, std::string>, std::vector<Said>> all;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    if (rows[i].status.state != FrameState::kDone) continue;
    for (const FindingRow& finding : rows[i].findings) {
      std::vector<Said>& said = all[{finding.code, finding.device}];
      if (said.empty() || said.back().number != done.size())
        said.push_back({done.size(), &finding});
    }
    done.push_back(i);
  }
  std::vector<SequenceEvent> events;
  for (const auto& [code_and_device, said] : all) {
    if (code_and_device.second.empty() && said.size() == done.size()) continue;
    for (std::size_t begin = 0; begin < said.size();) {
      std::size_t end = begin + 1;
      while (end < said.size() && said[end].number - said[end - 1].number <= kFramesBetween + 1)
        ++end;
      events.push_back(event_of_run(rows, std::span(said).subspan(begin, end - begin), done));
      begin = end;
    }
  }
  return events;
}

}  // namespace pencilscan
