// Through a real socket.
#include "server/rpc/materials.h"

#include <atomic>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <span>
#include <thread>

#include <gtest/gtest.h>

#include "btf/codec/material.h"
#include "server/jobs/synthesize_job.h"
#include "tests/server/support/server_fixture.h"
#include "tests/support/btf_files.h"

namespace tessera {
namespace {

TEST_F(ServerTest, OnlyContainersBecomeMaterials) {
  const auto bytes = SerializeMaterial(TinyMaterial());
  ASSERT_TRUE(bytes.ok()) << bytes.status();
  v1::CreateMaterialRequest request;
  request.set_name("materials/tiny");
  request.set_blob_sha256(stubs_->Upload("no container at all"));
  const auto create = [&] {
    return Stubs::Call(&v1::Materials::Stub::CreateMaterial, *stubs_->materials, request);
  };
  EXPECT_EQ(ReasonOf(create().status()), "FORMAT_INVALID");
  request.set_blob_sha256(DigestOf(*bytes));
  EXPECT_EQ(ReasonOf(create().status()), "BLOB_MISSING");
  stubs_->Upload(*bytes);
  const auto created = create();
  ASSERT_TRUE(created.ok()) << created.status();
  EXPECT_EQ(created->width(), 2u);
  EXPECT_EQ(created->num_coefficients(), 3u);
  EXPECT_EQ(created->provenance().licence(), "CC0");
  EXPECT_EQ(created->blob().size_bytes(), bytes->size());
  EXPECT_EQ(ReasonOf(create().status()), "NAME_TAKEN");
  request.set_replace(true);
  EXPECT_TRUE(create().ok());
  request.set_name("materials/Tiny");
  EXPECT_EQ(ReasonOf(create().status()), "NAME_INVALID");

  v1::CreateTileSetRequest as_tile_set;
  as_tile_set.set_name("arrangements/plane-16/tileSets/tiny");
  as_tile_set.set_blob_sha256(DigestOf(*bytes));
  EXPECT_EQ(
      ReasonOf(Stubs::Call(&v1::TileSets::Stub::CreateTileSet, *stubs_->tile_sets, as_tile_set).status()),
      "FORMAT_INVALID");
}

TEST_F(ServerTest, ARepeatedRequestIsAnsweredAgainAndDoneOnce) {
  v1::GenerateMaterialRequest request = Stubs::SmallMaterial("a");
  request.set_request_id("11111111-2222");
  const auto first = stubs_->Generate(request);
  ASSERT_TRUE(first.ok()) << first.status();
  ASSERT_EQ(stubs_->Wait(first->name())->state(), v1::Job::SUCCEEDED);
  const auto again = stubs_->Generate(request);  // the name is taken by now
  ASSERT_TRUE(again.ok()) << again.status();
  EXPECT_EQ(again->name(), first->name());
  request.set_size(64);
  EXPECT_EQ(stubs_->Generate(request).status().code(), absl::StatusCode::kInvalidArgument);

  v1::DeleteMaterialRequest remove;
  remove.set_name("materials/a");
  remove.set_request_id("delete");
  for (int i = 0; i < 2; ++i) {
    EXPECT_TRUE(Stubs::Call(&v1::Materials::Stub::DeleteMaterial, *stubs_->materials, remove).ok());
  }
  remove.set_request_id("another");
  EXPECT_EQ(ReasonOf(Stubs::Call(&v1::Materials::Stub::DeleteMaterial, *stubs_->materials, remove).status()),
            "NOT_FOUND");
}

TEST_F(ServerTest, WrongArgumentsAreRefusedBeforeAnyJob) {
  const auto reason_of = [&](const std::function<void(v1::GenerateMaterialRequest&)>& change) {
    v1::GenerateMaterialRequest request = Stubs::SmallMaterial("a");
    change(request);
    return ReasonOf(stubs_->Generate(request).status());
  };
  EXPECT_EQ(reason_of([](auto& request) { request.set_kind("velvet"); }), "ARGUMENT_INVALID");
  EXPECT_EQ(reason_of([](auto& request) { request.set_kind("heightmap"); }), "ARGUMENT_INVALID");
  EXPECT_EQ(reason_of([](auto& request) { request.set_lights("many"); }), "ARGUMENT_INVALID");
  EXPECT_EQ(reason_of([](auto& request) { request.set_size(16); }), "ARGUMENT_INVALID");
  EXPECT_EQ(reason_of([](auto& request) { request.set_size(100000); }), "ARGUMENT_INVALID");
  EXPECT_EQ(reason_of([](auto& request) { request.mutable_encode()->set_codec("auto"); }),
            "ARGUMENT_INVALID");
  EXPECT_EQ(reason_of([](auto& request) { request.mutable_encode()->set_max_error(0.1); }),
            "ARGUMENT_INVALID");
  EXPECT_EQ(reason_of([](auto& request) {
              request.mutable_encode()->set_codec("dfmf");
              request.mutable_encode()->set_rank(3);
              request.mutable_encode()->set_max_bytes(1000);
            }),
            "ARGUMENT_INVALID");
  EXPECT_EQ(reason_of([](auto& request) { request.mutable_encode()->set_codec("jpeg"); }),
            "ARGUMENT_INVALID");
  EXPECT_EQ(reason_of([](auto& request) { request.set_name("materials/a/b"); }), "NAME_INVALID");
  EXPECT_EQ(reason_of([](auto& request) { request.set_request_id(std::string(129, 'x')); }),
            "ARGUMENT_INVALID");

  v1::SynthesizeTileSetRequest synthesis;
  synthesis.set_material("materials/none");
  synthesis.set_name("arrangements/plane-16/tileSets/");
  const auto synthesize = [&] {
    return ReasonOf(
        Stubs::Call(&v1::TileSets::Stub::SynthesizeTileSet, *stubs_->tile_sets, synthesis).status());
  };
  EXPECT_EQ(synthesize(), "NOT_FOUND");
  synthesis.set_strip_height(7);
  EXPECT_EQ(synthesize(), "ARGUMENT_INVALID");
  synthesis.set_strip_height(40);
  EXPECT_EQ(synthesize(), "NOT_FOUND") << "the tile size is chosen";
  synthesis.set_tile_size(64);
  EXPECT_EQ(synthesize(), "ARGUMENT_INVALID");
  synthesis.set_strip_height(0);
  synthesis.set_effort(101);
  EXPECT_EQ(synthesize(), "ARGUMENT_INVALID");
  synthesis.set_effort(0);
  for (const char* const method : {"frame", "diamond-dp", "diamond-cut"}) {
    synthesis.set_method(method);
    EXPECT_EQ(synthesize(), "NOT_FOUND") << method;
  }
  synthesis.set_tile_size(63);
  EXPECT_EQ(synthesize(), "ARGUMENT_INVALID") << "diamonds are of even size";
  synthesis.set_tile_size(64);
  synthesis.set_method("hexagon");
  EXPECT_EQ(synthesize(), "ARGUMENT_INVALID");
  const absl::Status unknown =
      Stubs::Call(&v1::TileSets::Stub::SynthesizeTileSet, *stubs_->tile_sets, synthesis).status();
  EXPECT_NE(unknown.message().find("unknown method \"hexagon\", known: frame"), std::string::npos) << unknown;
  synthesis.set_method("frame");
  synthesis.set_recipe_json(R"({"colours": [{"of": "background", "hue_deg": 20}]})");
  EXPECT_EQ(synthesize(), "NOT_FOUND");
  synthesis.set_recipe_json(R"({"corners": [{"strip": {"colour": 1}, "end": "end", "position": [1, 1]}]})");
  const absl::Status misfit =
      Stubs::Call(&v1::TileSets::Stub::SynthesizeTileSet, *stubs_->tile_sets, synthesis).status();
  EXPECT_EQ(ReasonOf(misfit), "ARGUMENT_INVALID");
  EXPECT_NE(misfit.message().find("corners[0].strip.orientation: missing"), std::string::npos) << misfit;
  synthesis.set_method("diamond-cut");
  synthesis.set_recipe_json("{}");
  EXPECT_EQ(synthesize(), "ARGUMENT_INVALID") << "diamonds take no recipe";
  synthesis.clear_recipe_json();
  synthesis.set_method("hexagon");
  synthesis.set_name("arrangements/nowhere/tileSets/");
  EXPECT_EQ(synthesize(), "NOT_FOUND");

  v1::ImportMaterialRequest import;
  import.set_name("materials/a");
  import.set_archive_sha256(std::string(64, 'a'));
  const auto import_reason = [&] {
    return ReasonOf(Stubs::Call(&v1::Materials::Stub::ImportMaterial, *stubs_->materials, import).status());
  };
  EXPECT_EQ(import_reason(), "BLOB_MISSING");
  import.set_transfer("gamma:-1");
  EXPECT_EQ(import_reason(), "ARGUMENT_INVALID");
}

TEST(SynthesizeRequestTest, RecipesSpelledDifferentlyAreOneJob) {
  v1::SynthesizeTileSetRequest a;
  v1::SynthesizeTileSetRequest b;
  FillDefaults(a);
  EXPECT_TRUE(a.recipe_json().empty());
  a.set_recipe_json(R"({"colours": [{"of": "background", "hue_deg": 20}]})");
  b.set_recipe_json(R"( { "colours":[{"hue_deg":20,"of":"background"}]})");
  FillDefaults(a);
  FillDefaults(b);
  EXPECT_EQ(a.SerializeAsString(), b.SerializeAsString());
  b.set_recipe_json(R"({"colours": [{"of": "background", "hue_deg": 21}]})");
  FillDefaults(b);
  EXPECT_NE(a.SerializeAsString(), b.SerializeAsString());
}

TEST_F(ServerTest, AnArchiveThatIsNoneFailsItsJobWithoutShowingPaths) {
  v1::ImportMaterialRequest request;
  request.set_name("materials/a");
  request.set_archive_sha256(stubs_->Upload("neither zip nor exr"));
  const auto job = Stubs::Call(&v1::Materials::Stub::ImportMaterial, *stubs_->materials, request);
  ASSERT_TRUE(job.ok()) << job.status();
  const auto ended = stubs_->Wait(job->name());
  EXPECT_EQ(ended->state(), v1::Job::FAILED);
  EXPECT_NE(ended->error().message(), "");
  EXPECT_EQ(ended->error().message().find(folder_.path().string()), std::string::npos)
      << ended->error().message();
}

TEST_F(ServerTest, UploadedArchivesBecomeMaterials) {
  const auto btf = AsymmetricBtf(8, 6, WholeDegreeDirections(2, 3), WholeDegreeDirections(2, 4));
  const TempFolder scratch;
  FileMap files = Ubo2003Files(*btf, TestImageKind::kPng8, "");
  const auto zip_of = [&](const std::string& name) {
    WriteZip(files, scratch.path() / name, ZipPacking::kDeflated);
    std::ifstream file(scratch.path() / name, std::ios::binary);
    return std::string(std::istreambuf_iterator<char>(file), {});
  };
  v1::ImportMaterialRequest request;
  request.mutable_encode()->set_kl(4);
  request.mutable_encode()->set_kv(4);
  request.mutable_provenance()->set_licence("CC0");
  const auto import = [&](const std::string& name, const std::string& bytes) -> v1::Job {
    request.set_name("materials/" + name);
    request.set_archive_sha256(stubs_->Upload(bytes));
    const auto job = Stubs::Call(&v1::Materials::Stub::ImportMaterial, *stubs_->materials, request);
    EXPECT_TRUE(job.ok()) << job.status();
    return *stubs_->Wait(job->name());
  };
  for (const auto& [name, bytes] :
       FileMap{{"zip", zip_of("a.zip")}, {"exr", MultiPartExr(*btf, ExrPartKind::kHalf)}}) {
    const v1::Job job = import(name, bytes);
    ASSERT_EQ(job.state(), v1::Job::SUCCEEDED) << job.DebugString();
    const auto material = stubs_->GetMaterial(name);
    EXPECT_EQ(material->width(), 8u);
    EXPECT_EQ(material->height(), 6u);
    EXPECT_EQ(material->num_views(), btf->info().views.size());
    EXPECT_EQ(material->num_lights(), btf->info().lights.size());
    EXPECT_EQ(material->provenance().licence(), "CC0");
    const auto container = stubs_->Download(material->blob().sha256());
    EXPECT_TRUE(ParseMaterial(std::as_bytes(std::span(*container))).ok());
  }
  files.erase(files.begin());
  const v1::Job job = import("incomplete", zip_of("b.zip"));
  EXPECT_EQ(job.state(), v1::Job::FAILED);
  EXPECT_EQ(job.error().detail().reason(), "ARGUMENT_INVALID") << job.DebugString();
  EXPECT_EQ(job.error().message().find(folder_.path().string()), std::string::npos) << job.error().message();
  EXPECT_TRUE(std::filesystem::is_empty(folder_.path() / "scratch"));
}

TEST_F(ServerTest, TwoClientsRaceForOneName) {
  std::atomic<int> num_made = 0;
  std::atomic<int> num_taken = 0;
  {
    std::vector<std::jthread> clients;
    for (uint64_t i = 0; i < 2; ++i) {
      clients.emplace_back([&, i] {
        const Stubs stubs(server_->address());
        const auto job = stubs.Generate(Stubs::SmallMaterial("a", 3 + i));
        num_made += job.ok() ? 1 : 0;
        num_taken += ReasonOf(job.status()) == "NAME_TAKEN" ? 1 : 0;
      });
    }
  }
  EXPECT_EQ(num_made, 1);
  EXPECT_EQ(num_taken, 1);
}

TEST_F(ServerTest, ListsComeInPages) {
  for (const char* name : {"c", "a", "b"}) {
    const auto job = stubs_->Generate(Stubs::SmallMaterial(name));
    ASSERT_EQ(stubs_->Wait(job->name())->state(), v1::Job::SUCCEEDED);
  }
  v1::ListMaterialsRequest request;
  request.set_page_size(2);
  const auto list = [&] {
    return Stubs::Call(&v1::Materials::Stub::ListMaterials, *stubs_->materials, request);
  };
  const auto first = list();
  ASSERT_EQ(first->materials_size(), 2);
  EXPECT_EQ(first->materials(0).name(), "materials/a");
  request.set_page_token(first->next_page_token());
  const auto second = list();
  ASSERT_EQ(second->materials_size(), 1);
  EXPECT_EQ(second->materials(0).name(), "materials/c");
  EXPECT_EQ(second->next_page_token(), "");
  request.set_page_token("x");
  EXPECT_EQ(list().status().code(), absl::StatusCode::kInvalidArgument);
  const auto jobs = Stubs::Call(&v1::Jobs::Stub::ListJobs, *stubs_->jobs, v1::ListJobsRequest());
  EXPECT_EQ(jobs->jobs_size(), 3);
}

}  // namespace
}  // namespace tessera
