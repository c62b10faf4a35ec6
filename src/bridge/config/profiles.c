/* SPDX-License-Identifier: Apache-2.0 */
#include "config/config_private.h"

#include "config/keys.h"
#include "config/names.h"
#include "drivebridge/driver.h"
#include "reader/source.h"

#include <stdlib.h>
#include <string.h>

#define SECTIONS "profile, bus and drive"
#define OUT_OF_MEMORY "out of memory; free some and try again"

/* A profile that is named, and its contents. */
struct profile {
	char *path;
	unsigned line; /* line of the key that names it first */
	/* indices of its sections `profile`, `bus` and `drive`, or DB_READER_NO_SECTION */
	size_t own;
	size_t bus;
	size_t drive;
	const struct db_driver *driver; /* null: not known, which was reported */
};

struct profiles {
	struct db_load *load;
	struct profile *list;
	size_t count;
	const size_t *of; /* by section of the reader: its index in the list; PROFILE_NONE */
};

#define PROFILE_NONE ((size_t)-1)

/* The key in the section itself, not in its base. */
static const struct db_reader_key *find_own(const struct db_reader *reader, size_t section,
                                            const char *name)
{
	for (size_t i = 0; section != DB_READER_NO_SECTION && i < reader->key_count; i++) {
		const struct db_reader_key *key = &reader->keys[i];

		if (key->section == section && !key->refused && strcmp(key->name, name) == 0)
			return key;
	}
	return NULL;
}

static const char *value_of(const struct db_reader *reader, size_t section, const char *name)
{
	const struct db_reader_key *key = find_own(reader, section, name);

	return key && key->count > 0 ? key->values : NULL;
}

static bool lack_memory(struct db_load *load)
{
	db_messages_add_error(&load->messages, 0, OUT_OF_MEMORY);
	return false;
}

/* --- which there are -------------------------------------------------------------------------- */

/* To be freed; null when out of memory. */
static char *path_of(const struct db_load *load, const char *name)
{
	const char *first = load->messages.sources[0].path;
	const char *slash = strrchr(first, '/');
	char *path;

	if (name[0] == '/' || !slash)
		return strdup(name);
	return asprintf(&path, "%.*s%s", (int)(slash - first + 1), first, name) < 0 ? NULL : path;
}

/* Messages about a file show a part of it: who edits the configuration must not read others so. */
static bool is_open(struct db_load *load, const struct db_reader_key *key)
{
	static const char folder[] = "profiles/";
	const char *name = key->values;

	if (!db_messages_find_source(&load->messages, key->line)->edited ||
	    (strncmp(name, folder, strlen(folder)) == 0 && !strchr(name + strlen(folder), '/') &&
	     name[strlen(folder)] != '.' && name[strlen(folder)] != '\0'))
		return true;
	db_messages_add_error(
		&load->messages, key->line,
		"profile = %s is no file of the folder profiles; a file that is edited "
		"over the page may name only those, as profiles/NAME.conf",
		name);
	return false;
}

/* False after a message: no section can have such a profile. */
static bool is_possible(struct db_load *load, const char *path, unsigned line)
{
	for (size_t i = 0; i < load->messages.source_count; i++) {
		if (strcmp(load->messages.sources[i].path, path) != 0)
			continue;
		db_messages_add_error(&load->messages, line,
		                      "profile = %s is a file of the configuration itself; a "
		                      "profile is a file of its own, such as profiles/NAME.conf",
		                      path);
		return false;
	}
	return true;
}

/* The profile at this path, which is taken over; PROFILE_NONE when out of memory. */
static size_t add_profile(struct profiles *profiles, char *path, unsigned line)
{
	struct profile *more;

	for (size_t i = 0; i < profiles->count; i++) {
		if (strcmp(profiles->list[i].path, path) == 0) {
			free(path);
			return i;
		}
	}
	more = realloc(profiles->list, (profiles->count + 1) * sizeof(*more));
	if (!more) {
		free(path);
		return PROFILE_NONE;
	}
	profiles->list = more;
	more[profiles->count] = (struct profile){
		.path = path,
		.line = line,
		.own = DB_READER_NO_SECTION,
		.bus = DB_READER_NO_SECTION,
		.drive = DB_READER_NO_SECTION,
	};
	return profiles->count++;
}

/* False when out of memory. */
static bool list_profiles(struct profiles *profiles, size_t *of)
{
	struct db_load *load = profiles->load;
	const struct db_reader *reader = &load->reader;

	for (size_t i = 0; i < reader->section_count; i++) {
		const struct db_reader_section *section = &reader->sections[i];
		const struct db_reader_key *key = find_own(reader, i, "profile");
		char *path;

		of[i] = PROFILE_NONE;
		if (!key || section->refused ||
		    (strcmp(section->name, "bus") != 0 && strcmp(section->name, "drive") != 0))
			continue;
		if (strlen(key->values) < 1 || strlen(key->values) > 255) {
			db_messages_add_error(&load->messages, key->line,
			                      "profile is no path; 1 to 255 characters");
			continue;
		}
		if (!is_open(load, key))
			continue;
		path = path_of(load, key->values);
		if (!path)
			return false;
		if (!is_possible(load, path, key->line)) {
			free(path);
			continue;
		}
		of[i] = add_profile(profiles, path, key->line);
		if (of[i] == PROFILE_NONE)
			return false;
	}
	return true;
}

/* --- their texts ------------------------------------------------------------------------------ */

/* To be freed; null after a message. */
static char *take_text(struct db_load *load, const struct profile *profile)
{
	char *why = NULL;
	char *text;
	size_t size = 0;
	FILE *errors;

	for (size_t i = 0; i < load->offered_count; i++) {
		text = load->offered[i].text;
		if (strcmp(load->offered[i].path, profile->path) != 0 || !text)
			continue;
		load->offered[i].text = NULL;
		return text;
	}
	if (!load->path) {
		db_messages_add_error(
			&load->messages, profile->line,
			"profile = %s is not there; it is a file, and this text comes from none",
			profile->path);
		return NULL;
	}
	/* Messages about the file are reported at the line that names the profile. */
	errors = open_memstream(&why, &size);
	text = errors ? db_file_read(profile->path, errors) : NULL;
	if (errors)
		fclose(errors);
	if (!text)
		db_messages_add_error(&load->messages, profile->line, "profile = %.*s",
		                      why ? (int)strcspn(why, "\n") : 0, why ? why : "");
	free(why);
	return text;
}

/* False after a message. */
static bool add_source(struct db_load *load, const struct profile *profile)
{
	struct db_messages *messages = &load->messages;
	char *text = take_text(load, profile);
	char *path = text ? strdup(profile->path) : NULL;
	struct db_source *sources = NULL;

	if (path)
		sources = realloc(messages->sources,
		                  (messages->source_count + 1) * sizeof(*sources));
	if (!sources) {
		free(path);
		if (text)
			(void)lack_memory(load);
		free(text);
		return false;
	}
	sources[messages->source_count] = (struct db_source){
		.path = path,
		.text = text,
		.profile = true,
	};
	messages->sources = sources;
	messages->source_count++;
	load->config->sources = sources;
	load->config->source_count = messages->source_count;
	return true;
}

/* False after a message for each that is not available. */
static bool read_texts(struct profiles *profiles)
{
	struct db_load *load = profiles->load;
	bool good = true;
	size_t size = 1;
	char *at;

	/* Each path with its zero byte, and an empty one. */
	for (size_t i = 0; i < profiles->count; i++)
		size += strlen(profiles->list[i].path) + 1;
	load->profiles = calloc(1, size);
	if (!load->profiles)
		return lack_memory(load);
	at = load->profiles;
	for (size_t i = 0; i < profiles->count; i++)
		at = stpcpy(at, profiles->list[i].path) + 1;
	/* Before they are read: later changes then change the signature. */
	if (load->path && load->signature == db_config_signature(load->path, NULL))
		load->signature = db_config_signature(load->path, load->profiles);
	else
		load->signature = 0;
	for (size_t i = 0; i < profiles->count; i++)
		good = add_source(load, &profiles->list[i]) && good;
	return good;
}

/* --- what is in them -------------------------------------------------------------------------- */

static struct profile *profile_at(const struct profiles *profiles, unsigned line)
{
	const struct db_source *source = db_messages_find_source(&profiles->load->messages, line);
	size_t i = 0;

	while (strcmp(profiles->list[i].path, source->path) != 0)
		i++;
	return &profiles->list[i];
}

static void take_section(const struct profiles *profiles, size_t index)
{
	struct db_messages *messages = &profiles->load->messages;
	const struct db_reader_section *section = &profiles->load->reader.sections[index];
	struct profile *profile = profile_at(profiles, section->line);
	size_t *place = strcmp(section->name, "profile") == 0 ? &profile->own :
	                strcmp(section->name, "bus") == 0     ? &profile->bus :
	                strcmp(section->name, "drive") == 0   ? &profile->drive :
	                                                        NULL;

	if (!place)
		db_messages_add_error(messages, section->line,
		                      "a profile has no section '%s'; its sections are %s",
		                      section->name, SECTIONS);
	else if (section->title[0] != '\0')
		db_messages_add_error(messages, section->line,
		                      "section %s of a profile has no name, but '%s' was given: it "
		                      "holds for each %s that names the profile; write %s {",
		                      section->name, section->title,
		                      place == &profile->drive ? "drive" : "bus", section->name);
	else if (*place != DB_READER_NO_SECTION)
		db_messages_add_error(messages, section->line,
		                      "there is a section %s in this profile already; put all keys "
		                      "there",
		                      section->name);
	else
		*place = index;
}

/* The family of a profile; null after a message. */
static const struct db_driver *find_family(const struct profiles *profiles,
                                           const struct profile *profile)
{
	const struct db_reader *reader = &profiles->load->reader;
	struct db_messages *messages = &profiles->load->messages;
	const struct db_driver *const *drivers = profiles->load->built_in->drivers;
	const char *name = value_of(reader, profile->own, "protocol");
	const struct db_reader_key *given = find_own(reader, profile->own, "protocol");
	unsigned line = given ? given->line : profile->line;

	if (!name) {
		if (profile->own != DB_READER_NO_SECTION)
			line = reader->sections[profile->own].line;
		db_messages_add_error(messages, line,
		                      "%s does not say which drives it is for; begin it with "
		                      "profile { protocol = ... }, with the protocol of their bus",
		                      profile->path);
		return NULL;
	}
	for (; *drivers; drivers++) {
		if (strcmp((*drivers)->name, name) == 0)
			return *drivers;
	}
	db_messages_add_error(messages, line,
	                      "unknown protocol '%s'; what the protocol of a bus may be", name);
	return NULL;
}

/* True if the section of a profile may have this key. */
static bool check_key(const struct profiles *profiles, const struct profile *profile,
                      const struct db_reader_key *key)
{
	struct db_messages *messages = &profiles->load->messages;
	const struct db_driver *const *drivers = profiles->load->built_in->drivers;
	const char *section = profiles->load->reader.sections[key->section].name;
	const struct db_config_key *known = db_keys_find(section, key->name);
	char families[DB_FAMILIES_TEXT_MAX];

	if (strcmp(section, "profile") == 0) {
		if (strcmp(key->name, "protocol") == 0)
			return true;
		db_messages_add_error(messages, key->line,
		                      "unknown key '%s' in section profile; there is protocol",
		                      key->name);
		return false;
	}
	if (known && !known->of_kind) {
		db_messages_add_error(
			messages, key->line,
			"%s is no setting of a kind of drives; write it in the section of each %s",
			key->name, section);
		return false;
	}
	if (!profile->driver || (known && db_keys_fit(known, profile->driver)) ||
	    db_keys_find_option(profile->driver, section, key->name))
		return true;
	db_names_list_families(drivers, section, key->name, families);
	if (known || families[0] != '\0')
		db_messages_add_error(messages, key->line,
		                      "%s is no key of %s, which this profile is for; remove it",
		                      key->name, profile->driver->name);
	else
		db_messages_add_error(
			messages, key->line,
			"unknown key '%s' in section %s of a profile; the nearest one is '%s'",
			key->name, section, db_names_find_nearest(drivers, section, key->name));
	return false;
}

static bool is_single(const struct profiles *profiles, const struct db_reader_key *key)
{
	struct db_messages *messages = &profiles->load->messages;
	const struct db_reader_key *first = find_own(&profiles->load->reader, key->section,
	                                             key->name);

	if (key->list)
		db_messages_add_error(messages, key->line,
		                      "%s is a list; '%s' takes one value without braces",
		                      key->name, key->name);
	else if (first != key)
		db_messages_add_error(messages, key->line,
		                      "%s was set on %s already; keep one of them", key->name,
		                      db_messages_name_line(messages, first->line).text);
	return !key->list && first == key;
}

static void check_contents(const struct profiles *profiles, size_t first_section, size_t first_key)
{
	struct db_reader *reader = &profiles->load->reader;

	for (size_t i = first_section; i < reader->section_count; i++)
		take_section(profiles, i);
	for (size_t i = 0; i < profiles->count; i++)
		profiles->list[i].driver = find_family(profiles, &profiles->list[i]);
	for (size_t i = first_key; i < reader->key_count; i++) {
		struct db_reader_key *key = &reader->keys[i];

		if (key->section == DB_READER_NO_SECTION) {
			db_messages_add_error(&profiles->load->messages, key->line,
			                      "key '%s' stands outside of a section; the sections "
			                      "of a profile are %s",
			                      key->name, SECTIONS);
			key->refused = true;
		} else if (!is_single(profiles, key) ||
		           !check_key(profiles, profile_at(profiles, key->line), key)) {
			key->refused = true;
		}
	}
}

/* --- whose they are --------------------------------------------------------------------------- */

/* True if the bus's section has another protocol than the profile, which is reported. */
static bool is_other_family(const struct profiles *profiles, const struct profile *profile,
                            size_t bus, size_t section)
{
	const struct db_reader *reader = &profiles->load->reader;
	const char *protocol = value_of(reader, bus, "protocol");

	if (!profile->driver || !protocol || strcmp(protocol, profile->driver->name) == 0)
		return false;
	db_messages_add_error(&profiles->load->messages, find_own(reader, section, "profile")->line,
	                      "profile %s is for %s, but the protocol of bus '%s' is %s",
	                      profile->path, profile->driver->name, reader->sections[bus].title,
	                      protocol);
	return true;
}

/* The bus settings in a drive's profile must be true for the bus. */
static void check_bus_part(const struct profiles *profiles, const struct profile *profile,
                           size_t bus, size_t section)
{
	struct db_reader *reader = &profiles->load->reader;

	for (size_t i = 0; i < reader->key_count; i++) {
		const struct db_reader_key *key = &reader->keys[i];
		const struct db_reader_key *there;

		if (key->section != profile->bus || key->section == DB_READER_NO_SECTION ||
		    key->refused)
			continue;
		there = db_reader_find_key(reader, bus, key->name);
		if (there && strcmp(there->values, key->values) == 0)
			continue;
		db_messages_add_error(
			&profiles->load->messages, find_own(reader, section, "profile")->line,
			"profile %s has %s = %s for its bus, which bus '%s' does not have; name "
			"the profile in the section of the bus, and only there",
			profile->path, key->name, key->values, reader->sections[bus].title);
		return;
	}
}

/* The drive's own profile, or that of its bus. */
static void give_to_drive(const struct profiles *profiles, size_t index)
{
	struct db_reader *reader = &profiles->load->reader;
	const char *name = value_of(reader, index, "bus");
	size_t bus = name ? db_reader_find_section(reader, "bus", name) : DB_READER_NO_SECTION;
	size_t own = profiles->of[index];
	size_t of_bus = bus != DB_READER_NO_SECTION ? profiles->of[bus] : PROFILE_NONE;
	const struct profile *profile;

	if (own == PROFILE_NONE) {
		if (of_bus != PROFILE_NONE)
			reader->sections[index].base = profiles->list[of_bus].drive;
		return;
	}
	profile = &profiles->list[own];
	if (bus != DB_READER_NO_SECTION) {
		if (is_other_family(profiles, profile, bus, index))
			return;
		/* A bus that also names it may still have settings of its own. */
		if (of_bus != own)
			check_bus_part(profiles, profile, bus, index);
	}
	reader->sections[index].base = profile->drive;
}

static void give_sections(const struct profiles *profiles, size_t count)
{
	const struct db_reader *reader = &profiles->load->reader;

	for (size_t i = 0; i < count; i++) {
		if (profiles->of[i] != PROFILE_NONE &&
		    strcmp(reader->sections[i].name, "bus") == 0) {
			const struct profile *profile = &profiles->list[profiles->of[i]];

			if (!is_other_family(profiles, profile, i, i))
				profiles->load->reader.sections[i].base = profile->bus;
		}
	}
	for (size_t i = 0; i < count; i++) {
		if (strcmp(reader->sections[i].name, "drive") == 0)
			give_to_drive(profiles, i);
	}
}

/* --- all of it -------------------------------------------------------------------------------- */

bool db_profiles_read(struct db_load *load, const struct db_reader_rules *rules)
{
	size_t sections = load->reader.section_count;
	size_t keys = load->reader.key_count;
	size_t sources = load->messages.source_count;
	size_t *of = calloc(sections + 1, sizeof(*of));
	struct profiles profiles = { .load = load, .of = of };
	bool good = of && list_profiles(&profiles, of);

	if (!good)
		(void)lack_memory(load);
	if (good && profiles.count > 0)
		good = read_texts(&profiles) &&
		       db_reader_read_more(&load->reader, rules, &load->messages, sources);
	if (good && profiles.count > 0) {
		check_contents(&profiles, sections, keys);
		give_sections(&profiles, sections);
	}
	for (size_t i = 0; i < profiles.count; i++)
		free(profiles.list[i].path);
	free(profiles.list);
	free(of);
	return good;
}

bool db_profiles_note(struct db_load *load, size_t index, bool is_drive, size_t number)
{
	const struct db_reader *reader = &load->reader;
	struct db_config *config = load->config;
	size_t base = reader->sections[index].base;
	struct db_profile_use *use;
	const char *before = "";
	size_t size = 0;
	FILE *out;

	if (base == DB_READER_NO_SECTION)
		return true;
	use = realloc(config->profile_uses, (config->profile_use_count + 1) * sizeof(*use));
	if (!use)
		return false;
	config->profile_uses = use;
	use += config->profile_use_count++;
	*use = (struct db_profile_use){
		.is_drive = is_drive,
		.index = number,
		.path = db_messages_find_source(&load->messages, reader->sections[base].line)->path,
	};
	out = open_memstream(&use->keys, &size);
	if (!out)
		return false;
	for (size_t i = 0; i < reader->key_count; i++) {
		const struct db_reader_key *key = &reader->keys[i];

		if (key->section != base || key->refused || find_own(reader, index, key->name))
			continue;
		fprintf(out, "%s%s", before, key->name);
		before = ", ";
	}
	return fclose(out) == 0;
}

const struct db_profile_use *db_config_find_profile(const struct db_config *config, bool is_drive,
                                                    size_t index)
{
	for (size_t i = 0; i < config->profile_use_count; i++) {
		const struct db_profile_use *use = &config->profile_uses[i];

		if (use->is_drive == is_drive && use->index == index)
			return use;
	}
	return NULL;
}
