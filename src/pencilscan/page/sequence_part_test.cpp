#include "pencilscan/page/sequence_part.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <zlib.h>

#include "pencilscan/io/file.h"
#include "pencilscan/io/temporary_folder.h"
#include "pencilscan/page/experiment.h"

namespace pencilscan {
namespace {

using nlohmann::ordered_json;

const ordered_json kSequence = {{"format", "sequence/1"},
                                {"cameras", {"cam0"}},
                                {"events", {{{"frame", "000002"}, {"text", "cam0 moved"}}}},
                                {"table",
                                 {{{"frame", "000000"}, {"state", "done"}, {"points", 10}},
                                  {{"frame", "000001"}, {"state", "failed"}},
                                  {{"frame", "000002"},
                                   {"state", "done"},
                                   {"points", 12},
                                   {"cam0.crossing_px", 0.5},
                                   {"warnings", {"dark", "late"}}}}}};

TEST(SequencePart, HasTheTableByColumns) {
  const ordered_json columns = sequence_columns(kSequence);
  EXPECT_EQ(columns["frames"], ordered_json({"000000", "000001", "000002"}));
  EXPECT_EQ(columns["states"], ordered_json({"done", "failed", "done"}));
  EXPECT_EQ(columns["columns"]["points"], ordered_json({10, nullptr, 12}));
  EXPECT_EQ(columns["columns"]["cam0.crossing_px"], ordered_json({nullptr, nullptr, 0.5}));
  EXPECT_EQ(columns["remarks"], ordered_json::parse(R"([[2, "dark"], [2, "late"]])"));
  EXPECT_EQ(columns["events"], kSequence["events"]);
  EXPECT_EQ(columns["cameras"], kSequence["cameras"]);
  EXPECT_TRUE(columns["holes"].empty());
}

TEST(SequencePart, ToleratesAnyJson) {
  for (const char* text : {"3", "[]", R"({"table": 3, "events": {}})",
                           R"({"table": [1, {"frame": 2, "state": null, "warnings": 3}]})"}) {
    EXPECT_TRUE(sequence_columns(ordered_json::parse(text)).contains("frames")) << text;
  }
}

TEST(SequencePart, IsThatOfTheFolderAndSaysWhyItIsBroken) {
  const TemporaryFolder folder("SequencePart_\xe9");  // a name in Latin-1
  const auto& root = folder.path();
  EXPECT_TRUE(sequence_part(root).empty());
  const auto read = [&] {
    const std::string bytes = sequence_part(root);
    std::string text(100'000, '\0');
    uLongf size = text.size();
    EXPECT_EQ(uncompress(reinterpret_cast<Bytef*>(text.data()), &size,
                         reinterpret_cast<const Bytef*>(bytes.data()), bytes.size()),
              Z_OK);
    return ordered_json::parse(text.substr(0, size));
  };
  write_json(root / "sequence.json", kSequence);
  EXPECT_EQ(read()["frames"].size(), 3U);
  write_text(root / "sequence.json", "{");
  EXPECT_THAT(read()["broken"].get<std::string>(), ::testing::HasSubstr("sequence.json"));
}

TEST(SequencePart, ItsCsvMakesNoExperimentOfAnOutputFolder) {
  const TemporaryFolder folder("SequenceCsv");
  write_text(folder.path() / "sequence.csv", "frame,state\n000000,done\n");
  EXPECT_FALSE(find_experiment(folder.path()));
  write_text(folder.path() / "results.csv", "a,b\n1,2\n");
  EXPECT_TRUE(find_experiment(folder.path()));
}

}  // namespace
}  // namespace pencilscan
