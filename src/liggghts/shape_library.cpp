// The shapes of a simulation: read, shared between ranks, written to restart files. See shape_library.h.
#include "liggghts/shape_library.h"

#include <mpi.h>

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string_view>
#include <thread>
#include <utility>

#include "comm.h"
#include "io/shape_file.h"
#include "liggghts/host_error.h"

namespace LAMMPS_NS {

namespace {

constexpr int kMostMapped = 32;  // shapes that get inner maps: of more, each has few deep contacts

// Appends / takes a length-prefixed string; `take` returns false at the end of a damaged `data`.
void append(std::string& data, const std::string& item) {
  const std::uint64_t size = item.size();
  data.append(reinterpret_cast<const char*>(&size), sizeof size);
  data.append(item);
}

bool take(const std::string& data, std::size_t& at, std::string& item) {
  std::uint64_t size = 0;
  if (data.size() - at < sizeof size) return false;
  data.copy(reinterpret_cast<char*>(&size), sizeof size, at);
  at += sizeof size;
  if (data.size() - at < size) return false;
  item = data.substr(at, size);
  at += size;
  return true;
}

// Gives one rank's string to all ranks.
void broadcast(std::string& data, MPI_Comm world, int from = 0) {
  constexpr std::uint64_t kMost = 1u << 30;  // MPI counts in int
  std::uint64_t size = data.size();
  MPI_Bcast(&size, 1, MPI_UINT64_T, from, world);
  data.resize(size);
  for (std::uint64_t at = 0; at < size; at += kMost)
    MPI_Bcast(data.data() + at, static_cast<int>(std::min(kMost, size - at)), MPI_CHAR, from, world);
}

// The whole content of a file; false when it can't be read.
bool slurp(const std::string& file, std::string& text) {
  std::error_code ignored;
  if (std::filesystem::is_directory(file, ignored)) return false;
  std::ifstream in(file, std::ios::binary);
  if (!in) return false;
  text.assign(std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>());
  return !in.bad();
}

}  // namespace

// Fills sources_ (rank 0); returns an error message or nothing.
std::string ShapeLibrary::read_sources(const std::vector<std::string>& files) {
  for (const std::string& file : files) {
    Source source{std::filesystem::path(file).stem().string(), file, ""};
    if (!slurp(file, source.text)) return "Cannot read shape file " + file;
    sources_.push_back(std::move(source));
  }
  return "";
}

void ShapeLibrary::share_sources() {
  std::string data;
  for (const Source& source : sources_)
    for (const std::string& item : {source.name, source.file, source.text}) append(data, item);
  broadcast(data, world);
  sources_.clear();
  Source source;
  for (std::size_t at = 0;
       take(data, at, source.name) && take(data, at, source.file) && take(data, at, source.text);)
    sources_.push_back(source);
}

// Files of equal content share one shape: whose each is.
std::vector<std::size_t> ShapeLibrary::first_of_content() const {
  std::unordered_map<std::string_view, std::size_t> known;
  std::vector<std::size_t> first;
  for (std::size_t k = 0; k < sources_.size(); ++k)
    first.push_back(known.emplace(sources_[k].text, k).first->second);
  return first;
}

// Which rank makes each: the longest files first, as they take longest, in turns.
std::vector<int> ShapeLibrary::deal(const std::vector<std::size_t>& first) const {
  std::vector<std::size_t> order;
  for (std::size_t k = 0; k < first.size(); ++k)
    if (first[k] == k) order.push_back(k);
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return sources_[a].text.size() > sources_[b].text.size();
  });
  std::vector<int> maker(first.size(), -1);
  for (std::size_t k = 0; k < order.size(); ++k) maker[order[k]] = static_cast<int>(k % comm->nprocs);
  return maker;
}

// This rank's share, on the cores that the ranks of its machine leave it: a thread takes the next file until
// none is left. What comes out does not depend on who made it.
std::vector<ShapeLibrary::Made> ShapeLibrary::make(const std::vector<std::size_t>& mine, bool mapped) const {
  std::vector<Made> made(sources_.size());
  std::atomic<std::size_t> next{0};
  const auto work = [&] {
    for (std::size_t n; (n = next++) < mine.size();) {
      const std::size_t k = mine[n];
      try {
        auto content = nurbs::parse_shape(sources_[k].text, sources_[k].file);
        made[k].warnings = content.warnings;
        made[k].shape = nurbs::make_shape(sources_[k].name, std::move(content.surfaces), content.gyration,
                                          &made[k].warnings);
        if (mapped) made[k].shape->inner_map();
      } catch (const nurbs::ShapeError& error) {
        made[k].failure = error.what();
      }
    }
  };
  MPI_Comm machine;
  MPI_Comm_split_type(world, MPI_COMM_TYPE_SHARED, 0, MPI_INFO_NULL, &machine);
  int ranks = 1;
  MPI_Comm_size(machine, &ranks);
  MPI_Comm_free(&machine);
  const std::size_t cores = std::max<std::size_t>(std::thread::hardware_concurrency() / ranks, 1);
  std::vector<std::thread> others;
  for (std::size_t k = 1; k < std::min(cores, mine.size()); ++k) others.emplace_back(work);
  work();
  for (std::thread& other : others) other.join();
  return made;
}

// From the rank that made it to all: a shape, or what was wrong.
void ShapeLibrary::pass_on(int maker, Made& made) const {
  if (comm->nprocs == 1) return;
  std::string data;
  if (comm->me == maker) {
    append(data, made.failure);
    append(data, made.failure.empty() ? nurbs::pack(*made.shape) : "");
    for (const std::string& warning : made.warnings) append(data, warning);
  }
  broadcast(data, world, maker);
  if (comm->me == maker) return;
  std::size_t at = 0;
  std::string item;
  take(data, at, made.failure);
  take(data, at, item);
  if (made.failure.empty()) made.shape = nurbs::unpack(item);
  while (take(data, at, item)) made.warnings.push_back(item);
}

void ShapeLibrary::build() {
  shapes_.clear();
  rotors_.clear();
  numbers_.clear();
  const std::vector<std::size_t> first = first_of_content();
  const std::vector<int> maker = deal(first);
  std::vector<std::size_t> mine;
  int distinct = 0;
  for (std::size_t k = 0; k < maker.size(); ++k) {
    distinct += maker[k] >= 0;
    if (maker[k] == comm->me) mine.push_back(k);
  }
  std::vector<Made> made = make(mine, distinct <= kMostMapped);
  for (std::size_t k = 0; k < sources_.size(); ++k) {
    Source& source = sources_[k];
    if (!numbers_.emplace(source.name, static_cast<int>(k + 1)).second)
      nurbs_host::warn(FLERR, lmp,
                       "Two shapes are named " + source.name + "; that name means the first of them");
    if (first[k] == k) pass_on(maker[k], made[k]);
    const std::string& what = made[k].failure;
    if (!what.empty()) {
      const bool names_file = what.find(source.file) != std::string::npos;
      nurbs_host::fail_all(FLERR, lmp, names_file ? what : "Shape file " + source.file + ": " + what);
    }
    shapes_.push_back(first[k] == k ? made[k].shape : shapes_[first[k]]);
    for (const std::string& warning : made[k].warnings)
      nurbs_host::warn(FLERR, lmp, "Shape file " + source.file + ": " + warning);
    rotors_.push_back(nurbs::make_rotor(shapes_.back()->principal_gyration, shapes_.back()->principal_axes));
    if (comm->me != 0) source.text = std::string();
  }
}

void ShapeLibrary::read_files(const std::vector<std::string>& files) {
  sources_.clear();
  std::string failure;
  if (comm->me == 0) failure = read_sources(files);
  broadcast(failure, world);
  if (!failure.empty()) nurbs_host::fail_all(FLERR, lmp, failure);
  share_sources();
  build();
}

void ShapeLibrary::write_restart(FILE* file) const {
  std::string data;
  for (const Source& source : sources_)
    for (const std::string& item : {source.name, source.file, source.text}) append(data, item);
  const std::uint64_t size = data.size();
  std::fwrite(&size, sizeof size, 1, file);
  std::fwrite(data.data(), 1, data.size(), file);
}

void ShapeLibrary::read_restart(FILE* file) {
  sources_.clear();
  std::string failure;
  if (comm->me == 0) {
    std::uint64_t size = 0;
    std::string data;
    bool complete = std::fread(&size, sizeof size, 1, file) == 1;
    for (char block[4096]; complete && data.size() < size;) {
      const std::size_t wanted = std::min<std::uint64_t>(sizeof block, size - data.size());
      complete = std::fread(block, 1, wanted, file) == wanted;
      data.append(block, wanted);
    }
    Source source;
    std::size_t at = 0;
    while (complete && at < data.size()) {
      complete = take(data, at, source.name) && take(data, at, source.file) && take(data, at, source.text);
      if (complete) sources_.push_back(source);
    }
    if (!complete || sources_.empty()) failure = "The shapes in the restart file are incomplete";
  }
  broadcast(failure, world);
  if (!failure.empty()) nurbs_host::fail_all(FLERR, lmp, failure);
  share_sources();
  build();
}

int ShapeLibrary::number_of(const std::string& name) const {
  const auto found = numbers_.find(name);
  return found == numbers_.end() ? 0 : found->second;
}

int ShapeLibrary::require(const std::string& user, const std::string& name) const {
  const int number = number_of(name);
  if (number != 0) return number;
  std::string names;
  for (const Source& source : sources_) names += " " + source.name;
  nurbs_host::fail_all(FLERR, lmp, user + ": shape " + name + " is not one of atom_style nurbs:" + names);
}

}  // namespace LAMMPS_NS
