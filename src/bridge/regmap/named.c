/* SPDX-License-Identifier: Apache-2.0 */
#include "regmap/named.h"

#include "drivebridge/scale.h"
#include "regmap/clients.h"
#include "regmap/group.h"
#include "regmap/regmap_private.h"

#include <errno.h>
#include <math.h>
#include <modbus.h>
#include <stdio.h>
#include <string.h>

/* Null: no drive has this number, or it is being removed. */
static struct db_view_drive *find_drive(const struct db_registers *registers, uint16_t number)
{
	struct db_view_drive *drive = db_view_roster_find(registers->roster, number);

	return drive && !drive->leaving ? drive : NULL;
}

/* --- what there is ---------------------------------------------------------------------------- */

const struct db_bus_config *db_named_bus(const struct db_registers *registers, size_t place)
{
	return place < registers->roster->bus_count ? registers->roster->bus_configs[place] : NULL;
}

size_t db_named_drive_count(const struct db_registers *registers)
{
	return registers->roster->drive_count;
}

bool db_named_drive_at(const struct db_registers *registers, size_t place,
                       struct db_named_drive *drive)
{
	const struct db_view_drive *view;
	struct db_snapshot snapshot;
	bool known;

	if (place >= registers->roster->drive_count || registers->roster->drives[place]->leaving)
		return false;
	view = registers->roster->drives[place];
	db_axis_read(view->axis, &snapshot);
	known = view->config->counts_given || snapshot.feedback.counts_per_unit > 0.0f;
	*drive = (struct db_named_drive){
		.number = view->drive,
		.config = view->config,
		.bus = view->bus_config,
		.commands = db_driver_commands(view->bus_config, view->config),
		.unit = known ? db_scale_unit(view->driver, view->config) : "",
		.controlled = registers->roster->modbus->control == DB_CONTROL_DRIVE,
	};
	return true;
}

bool db_named_drive_find(const struct db_registers *registers, const char *name,
                         struct db_named_drive *drive)
{
	const struct db_view_roster *roster = registers->roster;

	for (size_t i = 0; i < roster->drive_count; i++) {
		if (strcmp(roster->drives[i]->config->name, name) == 0)
			return db_named_drive_at(registers, i, drive);
	}
	return false;
}

uint32_t db_named_generation(const struct db_registers *registers)
{
	return registers->generation;
}

static struct db_named_moment moment_of(const struct db_feedback *feedback,
                                        const struct db_axis_stats *stats)
{
	return (struct db_named_moment){ .taken = feedback->taken,
		                         .wall_us = feedback->taken_wall_us,
		                         .samples = stats->samples };
}

struct db_named_moment db_named_moment(const struct db_registers *registers, uint16_t number)
{
	const struct db_view_drive *drive = find_drive(registers, number);
	struct db_snapshot snapshot;

	if (!drive)
		return (struct db_named_moment){ .taken = 0 };
	db_axis_read(drive->axis, &snapshot);
	return moment_of(&snapshot.feedback, &snapshot.stats);
}

bool db_named_online(const struct db_registers *registers, uint16_t number)
{
	const struct db_view_drive *drive = find_drive(registers, number);
	struct db_snapshot snapshot;

	if (!drive)
		return false;
	db_axis_read(drive->axis, &snapshot);
	return (snapshot.feedback.status & DB_STATUS_ONLINE) != 0;
}

db_time db_named_cycle(const struct db_registers *registers, uint16_t number)
{
	const struct db_view_drive *drive = find_drive(registers, number);

	return drive ? (db_time)drive->bus_config->cycle_ms * DB_NS_PER_MS : 0;
}

const char *db_named_name(const struct db_registers *registers, uint16_t number)
{
	const struct db_view_drive *drive = find_drive(registers, number);

	return drive ? drive->config->name : "";
}

bool db_named_trouble(const struct db_registers *registers, uint16_t number,
                      struct db_trouble *trouble, uint16_t *error)
{
	const struct db_view_drive *drive = find_drive(registers, number);
	struct db_drive_image image;

	if (!drive)
		return false;
	db_image_fill_drive(&image, drive, NULL, DB_PART_PROCESS, 0, 0);
	*trouble = image.trouble;
	*error = image.feedback.error;
	return true;
}

#define MOVES (DB_STATUS_MOVING | DB_STATUS_HOMING | DB_STATUS_STOPPING)

bool db_named_place(const struct db_registers *registers, uint16_t number,
                    struct db_named_place *place)
{
	const struct db_view_drive *drive = find_drive(registers, number);
	struct db_nameplate_copy plate;
	struct db_origin_changes changes;
	struct db_snapshot snapshot;
	const struct db_feedback *feedback = &snapshot.feedback;

	if (!drive)
		return false;
	db_axis_read(drive->axis, &snapshot);
	/* Read after the snapshot: when that says that it is valid, this is. */
	db_axis_read_nameplate(drive->axis, &plate);
	changes = db_commander_origin(drive->commander);
	*place = (struct db_named_place){
		.online = (feedback->status & DB_STATUS_ONLINE) != 0,
		.identified = (feedback->status & DB_STATUS_PARAMS_VALID) != 0,
		.stands = !(feedback->status & MOVES),
		.homed = (feedback->status & DB_STATUS_HOMED) != 0,
		.lost = (feedback->status & DB_STATUS_ORIGIN_LOST) != 0 ||
		        feedback->doubt != DB_DOUBT_NONE,
		.position = feedback->position,
		.counts_per_unit = db_scale_is_open(drive->driver, drive->config, feedback) ?
		                           0.0 :
		                           db_scale_counts(drive->config, feedback),
		.unit = drive->config->counts_given || feedback->counts_per_unit > 0.0f ?
		                db_scale_unit(drive->driver, drive->config) :
		                "",
		.commands = changes.count,
		.restarts = feedback->restarts,
		.doubts = feedback->doubts,
	};
	place->homed_here = place->homed && changes.last == DB_CMD_HOME;
	memcpy(place->identity, plate.plate.identity, DB_IDENTITY_MAX);
	return true;
}

bool db_named_stands(const struct db_registers *registers, uint16_t number)
{
	const struct db_view_drive *drive = find_drive(registers, number);
	struct db_snapshot snapshot;

	if (!drive)
		return true;
	db_axis_read(drive->axis, &snapshot);
	return !(snapshot.feedback.status & MOVES) && !db_commander_is_to_move(drive->commander);
}

db_time db_named_stopped(const struct db_registers *registers, uint16_t number)
{
	const struct db_view_drive *drive = find_drive(registers, number);

	return drive ? db_commander_stopped(drive->commander) : 0;
}

void db_named_bus_stats(const struct db_registers *registers, size_t place,
                        struct db_bus_stats *stats)
{
	registers->ops->bus_stats(registers->context, registers->roster->buses[place], stats);
}

/* --- names ------------------------------------------------------------------------------------ */

static bool wants_all(const struct db_entry *entry)
{
	(void)entry;
	return true;
}

/* Leave out windows and drive tables: duplicates of the drives' registers. */
static bool wants_own(const struct db_entry *entry)
{
	return !(entry->cell.part & (DB_PART_DRIVES | DB_PART_WINDOWS));
}

const struct db_name_list *db_named_registers(struct db_registers *registers, uint16_t number)
{
	const struct db_view_drive *drive = find_drive(registers, number);
	struct db_scope scope = { .view = DB_VIEW_DRIVE };
	struct db_map *map = &db_view_space_whole(registers)->gateway;

	if (number == DB_NAMED_GATEWAY) {
		scope = (struct db_scope){ .view = DB_VIEW_GATEWAY,
			                   .buses = registers->roster->bus_count,
			                   .drives = registers->roster->drive_count };
	} else if (!drive) {
		return NULL;
	} else {
		scope.driver = drive->driver;
		for (map = registers->families; map->driver != drive->driver;)
			map = map->next;
	}
	if (!map->names)
		map->names = db_name_list_new(&scope,
		                              number == DB_NAMED_GATEWAY ? wants_own : wants_all);
	return map->names;
}

static bool wants_windows(const struct db_entry *entry)
{
	return (entry->cell.part & DB_PART_WINDOWS) != 0;
}

const struct db_name_list *db_named_windows(struct db_registers *registers)
{
	struct db_map *map = &db_view_space_whole(registers)->gateway;
	const struct db_scope scope = { .view = DB_VIEW_GATEWAY,
		                        .buses = registers->roster->bus_count,
		                        .drives = registers->roster->drive_count };

	if (!map->windows)
		map->windows = db_name_list_new(&scope, wants_windows);
	return map->windows;
}

const struct db_modbus_config *db_named_modbus(const struct db_registers *registers)
{
	return registers->roster->modbus;
}

/* --- reading ---------------------------------------------------------------------------------- */

static void read_value(const struct db_entry *entry, const void *image,
                       struct db_named_value *value)
{
	uint16_t words[DB_CELL_REGISTERS_MAX] = { 0 };
	union db_value decoded;

	if (entry->table != DB_TABLE_HOLDING) {
		const unsigned char *member = (const unsigned char *)image + entry->cell.offset;
		uint32_t wide = 0;
		uint16_t narrow;

		if (db_type_registers((enum db_type)entry->cell.type) > 1) {
			memcpy(&wide, member, sizeof(wide));
		} else {
			memcpy(&narrow, member, sizeof(narrow));
			wide = narrow;
		}
		value->kind = DB_NAMED_FLAG;
		value->whole = wide >> entry->cell.bit & 1;
		return;
	}
	db_words_encode(&entry->cell, image, false, words);
	if (entry->cell.type == DB_TEXT) {
		value->kind = DB_NAMED_TEXT;
		for (unsigned i = 0; i < 2u * entry->cell.registers; i++)
			value->text[i] = (char)(words[i / 2] >> (i % 2 == 0 ? 8 : 0));
		value->text[2u * entry->cell.registers] = '\0';
	} else if (entry->cell.type == DB_U64) {
		value->kind = DB_NAMED_WHOLE;
		value->whole = (int64_t)((uint64_t)words[0] << 48 | (uint64_t)words[1] << 32 |
		                         (uint64_t)words[2] << 16 | words[3]);
	} else if (!db_words_decode(&entry->cell, words, false, &decoded)) {
		value->kind = DB_NAMED_UNKNOWN; /* a float that is not a number */
	} else if (entry->cell.type == DB_F32) {
		value->kind = DB_NAMED_REAL;
		value->real = decoded.f;
	} else {
		value->kind = DB_NAMED_WHOLE;
		value->whole = (int64_t)db_value_number((enum db_type)entry->cell.type, decoded);
	}
}

bool db_named_read(struct db_registers *registers, const struct db_client *client, uint16_t number,
                   const struct db_entry *const *entries, size_t count,
                   struct db_named_moment *moment, db_named_visit_fn *visit, void *context)
{
	struct db_view_drive *drive = find_drive(registers, number);
	union {
		struct db_drive_image drive;
		struct db_gateway_image gateway;
	} image;
	uint16_t low = UINT16_MAX;
	uint16_t high = 0;
	unsigned parts = moment ? DB_PART_PROCESS : 0;

	if (moment)
		*moment = (struct db_named_moment){ .taken = 0 };
	if (!drive && number != DB_NAMED_GATEWAY)
		return false;
	for (size_t i = 0; i < count; i++) {
		parts |= entries[i]->cell.part;
		low = entries[i]->cell.offset < low ? entries[i]->cell.offset : low;
		high = entries[i]->cell.offset > high ? entries[i]->cell.offset : high;
	}
	if (drive) {
		db_clients_hear(drive, client);
		db_clients_feed(drive, client, DB_FEED_REQUESTS);
		db_read_image(&image.drive, drive, client, parts, low, high);
		if (moment)
			*moment = moment_of(&image.drive.feedback, &image.drive.stats);
	} else {
		db_image_fill_gateway(&image.gateway, registers, db_view_space_whole(registers),
		                      client, parts, low, high);
	}
	for (size_t i = 0; i < count; i++) {
		struct db_named_value value = { .kind = DB_NAMED_UNKNOWN };

		if (!drive || db_read_is_known(drive, &image.drive, &entries[i]->cell))
			read_value(entries[i], &image, &value);
		else if ((entries[i]->cell.flags & DB_ROW_PARAM) &&
		         db_params_have(image.drive.nameplate.plate.missing,
		                        entries[i]->cell.param))
			value.kind = DB_NAMED_MISSING;
		if (drive && value.kind != DB_NAMED_UNKNOWN && value.kind != DB_NAMED_MISSING &&
		    (entries[i]->cell.flags & DB_ROW_PARAM))
			value.told = db_told_time(
				image.drive.nameplate.plate.told[entries[i]->cell.param],
				registers->ops->now(registers->context));
		visit(context, entries[i]->name, entries[i], &value);
	}
	return true;
}

struct bus_figures {
	const void *image;
	db_named_visit_fn *visit;
	void *context;
};

/* "bus1_cycle_us" is cycle_us of every bus, "line1_state" line_state. */
static void visit_bus(void *context, const struct db_entry *entry)
{
	const struct bus_figures *figures = context;
	struct db_named_value value = { .kind = DB_NAMED_UNKNOWN };
	char name[DB_ROW_NAME_MAX];
	const char *mark = strchr(entry->name, '_');

	if (entry->table != DB_TABLE_HOLDING || entry->cell.part != DB_PART_BUSES || !mark)
		return;
	if (strncmp(entry->name, "bus", 3) == 0 || strncmp(mark, "_line_", 6) == 0)
		strcpy(name, mark + 1);
	else
		snprintf(name, sizeof(name), "line%s", mark);
	read_value(entry, figures->image, &value);
	figures->visit(figures->context, name, entry, &value);
}

bool db_named_read_bus(const struct db_registers *registers, size_t place, db_named_visit_fn *visit,
                       void *context)
{
	const struct db_scope scope = { .view = DB_VIEW_GATEWAY, .buses = 1 };
	struct db_gateway_image image;
	struct bus_figures figures = { .image = &image, .visit = visit, .context = context };

	if (place >= registers->roster->bus_count)
		return false;
	db_image_fill_bus(&image.buses[0], registers, place);
	db_table_visit(&scope, visit_bus, &figures);
	return true;
}

void db_named_hear(struct db_registers *registers, const struct db_client *client, uint16_t number)
{
	struct db_view_drive *drive = find_drive(registers, number);

	if (!drive)
		return;
	db_clients_hear(drive, client);
	db_clients_feed(drive, client, DB_FEED_REQUESTS);
}

bool db_named_may_command(struct db_registers *registers, const struct db_client *client,
                          uint16_t number)
{
	struct db_view_drive *drive = find_drive(registers, number);

	return drive && db_clients_may_write(drive, client, false);
}

/* --- writing ---------------------------------------------------------------------------------- */

bool db_named_encode(const struct db_registers *registers, const struct db_entry *entry,
                     double number, uint16_t words[DB_NAMED_WORDS])
{
	struct db_cell cell = entry->cell;
	union db_value value;

	if (!db_value_from_number((enum db_type)cell.type, number, &value))
		return false;
	/* As parameters are stored: 32 bits for all types. */
	cell.offset = 0;
	cell.flags |= DB_ROW_PARAM;
	db_words_encode(&cell, &value, registers->roster->modbus->low_word_first, words);
	return true;
}

bool db_named_is_argument(const struct db_entry *entry, enum db_arg arg)
{
	const struct db_arg_row *row = &db_arg_rows[arg];
	size_t offset = offsetof(struct db_drive_image, block.args) + row->offset;

	return entry->table == DB_TABLE_HOLDING && (entry->cell.part & DB_PART_BLOCK) &&
	       entry->cell.offset >= offset && entry->cell.offset < offset + row->bytes;
}

void db_named_store_argument(const struct db_entry *entry, double number, struct db_args *args)
{
	struct db_cell cell = entry->cell;
	union db_value value;

	/* The row has the argument's place in an image; here the arguments are a separate
	 * struct. */
	cell.offset = (uint16_t)(cell.offset - offsetof(struct db_drive_image, block.args));
	if (db_value_from_number((enum db_type)cell.type, number, &value))
		db_words_store(&cell, value, args);
}

void db_named_unit(const struct db_registers *registers, uint16_t number,
                   const struct db_entry *entry, char unit[DB_NAMED_UNIT_MAX])
{
	static const char users[] = "user units";
	const struct db_view_drive *drive = find_drive(registers, number);
	const char *own = entry->param ? entry->param->unit : entry->row ? entry->row->unit : NULL;
	const char *name = "";

	if (own == db_velocity_unit && drive && drive->bus_config->driver->velocity_unit)
		own = drive->bus_config->driver->velocity_unit;
	if (own && drive && strncmp(own, users, sizeof(users) - 1) == 0)
		name = db_scale_unit(drive->driver, drive->config);
	if (name[0] != '\0')
		own += sizeof(users) - 1;
	snprintf(unit, DB_NAMED_UNIT_MAX, "%s%s", name, own ? own : "");
}

bool db_named_limit(const struct db_registers *registers, uint16_t number,
                    const struct db_entry *entry, double *min, double *max)
{
	const struct db_view_drive *drive = find_drive(registers, number);
	struct db_allowed allowed;

	if (!drive || entry->table != DB_TABLE_HOLDING)
		return false;
	allowed = db_commander_allowed(drive->commander);
	if (strcmp(entry->name, "position") == 0) {
		*min = allowed.min_position;
		*max = allowed.max_position;
		return isfinite(*min) && isfinite(*max);
	}
	if (!db_named_is_argument(entry, DB_ARG_TARGET_VELOCITY) &&
	    strcmp(entry->name, "velocity") != 0)
		return false;
	*max = allowed.max_velocity;
	*min = -*max;
	return isfinite(*max);
}

int db_named_write(struct db_registers *registers, const struct db_client *client, uint16_t number,
                   enum db_table table, uint16_t address, uint16_t count, const uint16_t *values,
                   struct db_write_token token)
{
	struct db_view_drive *drive = find_drive(registers, number);

	if (number == DB_NAMED_GATEWAY)
		return db_gateway_write(registers, db_view_space_whole(registers), client, table,
		                        address, count, values, token);
	if (!drive)
		return MODBUS_EXCEPTION_GATEWAY_PATH;
	db_clients_hear(drive, client);
	return db_write_drive(drive, client, table, address, count, values, token);
}

enum db_result db_named_write_result(struct db_registers *registers, const struct db_client *client,
                                     uint16_t number, uint8_t exception)
{
	const struct db_view_drive *drive = find_drive(registers, number);
	struct db_command_state state;

	if (!drive)
		return db_exception_result(exception);
	db_commander_state(drive->commander, client, &state,
	                   registers->ops->now(registers->context));
	/* Writes that never reached the commander have no result. */
	return db_exception_of((enum db_result)state.results.write_result) == exception ?
	               (enum db_result)state.results.write_result :
	               db_exception_result(exception);
}

bool db_named_commands(uint16_t number, const struct db_entry *entry, double value)
{
	return number != DB_NAMED_GATEWAY && entry->table == DB_TABLE_HOLDING &&
	       (entry->cell.part & DB_PART_BLOCK) &&
	       entry->cell.offset == offsetof(struct db_drive_image, block.command) &&
	       value > 0.0 && !db_command_is_stop((enum db_command)value);
}

bool db_named_moves(uint16_t number, const struct db_entry *entry, double value)
{
	const struct db_cell *cell = &entry->cell;

	if (entry->table != DB_TABLE_HOLDING)
		return false;
	if (number == DB_NAMED_GATEWAY)
		return (cell->part & DB_PART_GROUP) && value > 0.0 &&
		       cell->offset == offsetof(struct db_gateway_image, group_start);
	if (!(cell->part & DB_PART_BLOCK))
		return false;
	return cell->offset == offsetof(struct db_drive_image, block.hold_beat) ||
	       (cell->offset == offsetof(struct db_drive_image, block.command) &&
	        db_command_may_move((enum db_command)value));
}

void db_named_gather(struct db_registers *registers, bool gathers)
{
	db_group_gather(registers, gathers);
}

struct db_write_answer db_named_run(struct db_registers *registers, const struct db_client *client,
                                    uint16_t number, enum db_command command,
                                    const struct db_args *args, uint32_t hold_ms,
                                    struct db_write_token token, uint32_t *entry)
{
	struct db_view_drive *drive = find_drive(registers, number);
	bool stop = db_command_is_stop(command);
	struct db_request request = {
		.client = *client,
		.command = command,
		.args = stop ? NULL : args,
		.hold_ms = (uint16_t)hold_ms, /* at most DB_HOLD_MAX_MS */
	};
	struct db_history_entry newest;
	struct db_write_answer answer;

	*entry = 0;
	if (!drive)
		return (struct db_write_answer){ .result = DB_RESULT_OFFLINE };
	db_clients_hear(drive, client);
	/* A stop is carried out whichever client has control. */
	if (!db_clients_may_write(drive, client, stop) && !stop) {
		db_commander_refuse(drive->commander, &request, DB_RESULT_NOT_IN_CONTROL, 0);
		return (struct db_write_answer){ .result = DB_RESULT_NOT_IN_CONTROL };
	}
	answer = db_commander_ask(drive->commander, &request, token,
	                          registers->ops->now(registers->context));
	if (db_commander_history(drive->commander, 0, &newest))
		*entry = newest.sequence;
	return answer;
}

bool db_named_beat(struct db_registers *registers, const struct db_client *client, uint16_t number)
{
	struct db_view_drive *drive = find_drive(registers, number);

	if (!drive ||
	    !db_commander_beat(drive->commander, client, registers->ops->now(registers->context)))
		return false;
	db_clients_hear(drive, client);
	db_clients_feed(drive, client, DB_FEED_WRITES);
	return true;
}

void db_named_desert(struct db_registers *registers, const struct db_client *client)
{
	db_time now = registers->ops->now(registers->context);

	for (size_t i = 0; i < registers->roster->drive_count; i++)
		db_commander_desert(registers->roster->drives[i]->commander, client, now);
}

enum db_result db_named_outcome(const struct db_registers *registers, uint16_t number,
                                uint32_t entry)
{
	const struct db_view_drive *drive = find_drive(registers, number);

	return drive ? db_commander_outcome(drive->commander, entry) : DB_RESULT_CANCELLED;
}
