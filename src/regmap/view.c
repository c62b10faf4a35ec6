/* SPDX-License-Identifier: Apache-2.0 */
#include "regmap/view.h"

#include "drivebridge/version.h"
#include "regmap/exception.h"
#include "regmap/vsmd_view.h"
#include "regmap/words.h"

#include <errno.h>
#include <modbus.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Something due is late by so much only when this process was held, or its machine. */
#define HELD_TIME (100 * DB_NS_PER_MS)

/* --- reading ------------------------------------------------------------------------------------- */

static const struct db_index *table_of(const struct view_map *map, enum db_table table)
{
	switch (table) {
	case DB_TABLE_COILS:
		return &map->coils;
	case DB_TABLE_DISCRETE:
		return &map->discrete;
	default:
		return &map->holding;
	}
}

/* The cells of a read, and all that decides whether it is allowed. */
struct span {
	const struct db_cell *cells;
	uint16_t count;
	unsigned parts;
	unsigned flags;
	unsigned without; /* cells with these flags are not there for this table: 0 */
	uint16_t low;     /* offsets of the first and the last member of the image that is read */
	uint16_t high;
};

static uint8_t find_span(const struct db_index *index, enum db_table table, uint16_t address,
                         uint16_t count, struct span *span)
{
	uint16_t first = db_index_touch(index, address, count, &span->count);

	if (first == DB_NO_CELL)
		return MODBUS_EXCEPTION_ILLEGAL_DATA_ADDRESS;
	span->cells = &index->cells[first];
	span->without = table == DB_TABLE_INPUT ? DB_ROW_WRITABLE : 0;
	span->parts = 0;
	span->flags = 0;
	span->low = UINT16_MAX;
	span->high = 0;
	for (uint16_t i = 0; i < span->count; i++) {
		if (span->cells[i].flags & span->without)
			continue;
		span->parts |= span->cells[i].part;
		span->flags |= span->cells[i].flags;
		if (span->cells[i].offset < span->low)
			span->low = span->cells[i].offset;
		if (span->cells[i].offset > span->high)
			span->high = span->cells[i].offset;
	}
	return span->low == UINT16_MAX ? MODBUS_EXCEPTION_ILLEGAL_DATA_ADDRESS : 0;
}

/* What no cell covers is 0. */
static void copy_registers(const struct span *span, const void *image, bool low_first,
                           uint16_t address, uint16_t count, uint16_t *values)
{
	unsigned end = (unsigned)address + count;

	memset(values, 0, count * sizeof values[0]);
	for (uint16_t i = 0; i < span->count; i++) {
		const struct db_cell *cell = &span->cells[i];
		uint16_t words[DB_CELL_REGISTERS_MAX];

		if (cell->flags & span->without)
			continue;
		/* Whole cells, nearly always, go straight to their place. */
		if (cell->address >= address && (unsigned)cell->address + cell->registers <= end) {
			db_words_encode(cell, image, low_first, &values[cell->address - address]);
			continue;
		}
		db_words_encode(cell, image, low_first, words);
		for (unsigned j = 0; j < cell->registers; j++) {
			unsigned at = (unsigned)cell->address + j;

			if (at >= address && at < end)
				values[at - address] = words[j];
		}
	}
}

static void copy_bits(const struct span *span, const void *image, uint16_t address, uint16_t count,
                      uint16_t *values)
{
	memset(values, 0, count * sizeof values[0]);
	for (uint16_t i = 0; i < span->count; i++) {
		const struct db_cell *cell = &span->cells[i];
		const unsigned char *member = (const unsigned char *)image + cell->offset;
		uint32_t wide;
		uint16_t narrow;

		if (db_type_registers((enum db_type)cell->type) > 1) {
			memcpy(&wide, member, sizeof wide);
		} else {
			memcpy(&narrow, member, sizeof narrow);
			wide = narrow;
		}
		values[cell->address - address] = (uint16_t)(wide >> cell->bit & 1);
	}
}

uint8_t view_unreachable(const struct db_feedback *feedback)
{
	return feedback->status & DB_STATUS_BUS_UP ? MODBUS_EXCEPTION_GATEWAY_TARGET :
	                                             MODBUS_EXCEPTION_GATEWAY_PATH;
}

/* Old data is never shown as fresh. */
static uint8_t check_measured(const struct view_drive *drive, const struct db_feedback *feedback)
{
	if (drive->registers->layout->modbus->stale_values)
		return 0;
	if (!(feedback->status & DB_STATUS_ONLINE) || feedback->taken == 0)
		return view_unreachable(feedback);
	return 0;
}

/*
 * Parameters that are not known yet, or not any more, are not shown. When all were read and one was not
 * among them, this model does not have it: it is 0, unless the read touches nothing else.
 */
static uint8_t check_params(const struct view_drive *drive, const struct span *span,
                            struct db_drive_image *image)
{
	bool stale = drive->registers->layout->modbus->stale_values;
	uint32_t wanted = DB_STATUS_ONLINE | DB_STATUS_PARAMS_VALID;
	bool fresh = (image->feedback.status & wanted) == wanted;
	bool any = false;

	for (uint16_t i = 0; i < span->count; i++) {
		const struct db_cell *cell = &span->cells[i];

		if (!(cell->flags & DB_ROW_PARAM)) {
			any = true;
		} else if (image->plate.valid & (UINT64_C(1) << cell->param)) {
			if (!fresh && !stale)
				return view_unreachable(&image->feedback);
			any = true;
		} else if (fresh) {
			image->plate.values[cell->param].u = 0;
		} else {
			return view_unreachable(&image->feedback);
		}
	}
	return any ? 0 : MODBUS_EXCEPTION_ILLEGAL_DATA_ADDRESS;
}

static void fill_control(struct db_drive_image *image, const struct view_drive *drive,
                         const struct db_client *client)
{
	db_time now = drive->registers->ops->now(drive->registers->context);
	const struct db_client *holder = db_control_holder(&drive->control, now);

	image->control_request = holder && holder->id == client->id;
	image->control_port = holder ? holder->port : 0;
	image->control_holder = holder ? db_client_ipv4(holder->address) : 0;
	image->control_remaining_ms = db_control_remaining_ms(&drive->control, now);
}

static uint8_t read_drive(const struct view_drive *drive, const struct db_client *client,
                          enum db_table table, uint16_t address, uint16_t count, uint16_t *values)
{
	struct db_drive_image image;
	struct span span;
	uint8_t exception = find_span(table_of(drive->map, table), table, address, count, &span);

	if (exception)
		return exception;
	view_fill_drive(&image, drive, client, span.parts, span.low, span.high);
	if (span.parts & DB_PART_PROCESS)
		fill_control(&image, drive, client);
	if (span.flags & DB_ROW_MEASURED)
		exception = check_measured(drive, &image.feedback);
	if (!exception && (span.flags & DB_ROW_PARAM))
		exception = check_params(drive, &span, &image);
	if (exception)
		return exception;
	if (table == DB_TABLE_HOLDING || table == DB_TABLE_INPUT)
		copy_registers(&span, &image, drive->registers->layout->modbus->low_word_first,
		               address, count, values);
	else
		copy_bits(&span, &image, address, count, values);
	return 0;
}

static uint8_t read_gateway(const struct db_registers *registers, const struct db_client *client,
                            enum db_table table, uint16_t address, uint16_t count, uint16_t *values)
{
	struct db_gateway_image image;
	struct span span;
	uint8_t exception = find_span(table_of(&registers->layout->gateway, table), table, address,
	                              count, &span);

	if (exception)
		return exception;
	view_fill_gateway(&image, registers, client, span.parts, span.low, span.high);
	copy_registers(&span, &image, registers->layout->modbus->low_word_first, address, count,
	               values);
	return 0;
}

/* --- the backend ----------------------------------------------------------------------------------- */

/* Null for the gateway. Only asked for units that exist. */
static struct view_drive *drive_of(const struct db_registers *registers, uint8_t unit)
{
	uint16_t drive = registers->layout->units[unit];

	return drive < registers->layout->drive_count ? registers->layout->drives[drive] : NULL;
}

static uint8_t backend_unit(void *context, uint8_t unit)
{
	const struct db_registers *registers = context;

	return registers->layout->units[unit] == VIEW_NOTHING ? MODBUS_EXCEPTION_GATEWAY_PATH : 0;
}

void view_feed(struct view_drive *drive, const struct db_client *client, enum db_watchdog_feed by)
{
	const struct db_registers *registers = drive->registers;
	db_time arrived = db_client_arrived(client, registers->ops->now(registers->context));

	if (db_commander_feed(drive->commander, client, by, arrived))
		drive->fed_by = *client;
}

/*
 * Something that was due long ago has not been done: this process was held. A client asks for one thing
 * after the other and may have waited with its first one for all that time, so that one stands for
 * every drive that it had kept going.
 */
static void feed_all(const struct db_registers *registers, const struct db_client *client,
                     db_time now)
{
	if (now - HELD_TIME < registers->due)
		return;
	for (size_t i = 0; i < registers->layout->drive_count; i++) {
		struct view_drive *drive = registers->layout->drives[i];

		if (drive->fed_by.id == client->id)
			view_feed(drive, client, DB_FEED_HEARTBEAT);
	}
}

/* Who may only look does not keep a machine running, nor who does not control it. */
static void hear(struct view_drive *drive, const struct db_client *client, enum db_watchdog_feed by)
{
	const struct db_registers *registers = drive->registers;
	db_time now = registers->ops->now(registers->context);

	db_commander_hear(drive->commander, client, now);
	feed_all(registers, client, now);
	if (!client->may_write || !db_control_holds(&drive->control, client, now))
		return;
	db_control_hear(&drive->control, client, db_client_arrived(client, now), now);
	view_feed(drive, client, by);
}

static uint8_t backend_read(void *context, const struct db_client *client, uint8_t unit,
                            enum db_table table, uint16_t address, uint16_t count, uint16_t *values)
{
	const struct db_registers *registers = context;
	struct view_drive *drive = drive_of(registers, unit);

	if (drive) {
		hear(drive, client, DB_FEED_REQUESTS);
		if (registers->layout->vendor_units[unit])
			return vsmd_view_read(drive, table, address, count, values);
		return read_drive(drive, client, table, address, count, values);
	}
	if (backend_unit(context, unit))
		return MODBUS_EXCEPTION_GATEWAY_PATH;
	return read_gateway(registers, client, table, address, count, values);
}

static int backend_write(void *context, const struct db_client *client, uint8_t unit,
                         enum db_table table, uint16_t address, uint16_t count,
                         const uint16_t *values, struct db_write_token token)
{
	struct view_drive *drive = drive_of(context, unit);

	if (drive) {
		hear(drive, client, DB_FEED_WRITES);
		if (drive->registers->layout->vendor_units[unit])
			return vsmd_view_write(drive, client, table, address, count, values, token);
		return view_write(drive, client, table, address, count, values, token);
	}
	if (backend_unit(context, unit))
		return MODBUS_EXCEPTION_GATEWAY_PATH;
	return view_write_gateway(context, client, table, address, count, values, token);
}

static int backend_write_same(void *context, const struct db_client *client, uint8_t unit,
                              uint16_t address, uint16_t value, struct db_write_token token)
{
	const struct db_registers *registers = context;
	struct view_drive *drive = drive_of(registers, unit);

	if (!drive)
		return view_check_write(&registers->layout->gateway, address);
	hear(drive, client, DB_FEED_WRITES);
	if (registers->layout->vendor_units[unit])
		return vsmd_view_write_same(drive, client, address, value, token);
	return view_write_same(drive, client, address, value, token);
}

static size_t backend_server_id(void *context, uint8_t unit, char *text, size_t size, bool *running)
{
	const struct db_registers *registers = context;
	const struct view_drive *drive = drive_of(registers, unit);
	struct db_nameplate plate;
	struct db_snapshot snapshot;
	int length;

	if (!drive) {
		*running = true;
		length = snprintf(text, size, "drivebridge %s gateway", DB_VERSION);
	} else {
		db_axis_read(drive->axis, &snapshot);
		db_axis_read_nameplate(drive->axis, &plate);
		*running = (snapshot.feedback.status & DB_STATUS_ONLINE) != 0;
		length = snprintf(text, size, "drivebridge %s unit %u %s%s%.*s", DB_VERSION,
		                  drive->config->unit, drive->config->name,
		                  plate.identity[0] ? " " : "", DB_IDENTITY_MAX, plate.identity);
	}
	if (length < 0 || size == 0)
		return 0;
	return (size_t)length < size ? (size_t)length : size - 1;
}

/* Objects of FC 43/14. */
enum device_object {
	OBJECT_VENDOR_NAME,
	OBJECT_PRODUCT_CODE,
	OBJECT_REVISION,
	OBJECT_VENDOR_URL,
	OBJECT_PRODUCT_NAME,
	OBJECT_MODEL_NAME,
	OBJECT_USER_APPLICATION_NAME,
};

static const char *model_of(const struct view_drive *drive)
{
	char *model = drive->registers->model;
	struct db_nameplate plate;

	db_axis_read_nameplate(drive->axis, &plate);
	if (plate.identity[0] == '\0')
		return drive->driver->title;
	memcpy(model, plate.identity, sizeof plate.identity);
	model[sizeof plate.identity] = '\0';
	return model;
}

static const char *backend_device_id(void *context, uint8_t unit, uint8_t object)
{
	struct view_drive *drive = drive_of(context, unit);

	switch (object) {
	case OBJECT_VENDOR_NAME:
		return "drivebridge";
	case OBJECT_PRODUCT_CODE:
		return drive ? drive->driver->name : "gateway";
	case OBJECT_REVISION:
		return DB_VERSION;
	case OBJECT_PRODUCT_NAME:
		return "drivebridge";
	case OBJECT_MODEL_NAME:
		return drive ? model_of(drive) : NULL;
	case OBJECT_USER_APPLICATION_NAME:
		return drive ? drive->config->name : NULL;
	default:
		return NULL;
	}
}

static void release_control(const struct db_registers *registers, const struct db_client *client)
{
	for (size_t i = 0; i < registers->layout->drive_count; i++)
		db_control_release(&registers->layout->drives[i]->control, client);
}

/* Its number may become another's. */
static void forget(const struct db_registers *registers, const struct db_client *client)
{
	release_control(registers, client);
	for (size_t i = 0; i < registers->layout->drive_count; i++)
		db_commander_forget(registers->layout->drives[i]->commander, client);
}

static void backend_restricted(void *context, const struct db_client *client)
{
	release_control(context, client);
}

static void backend_client(void *context, const struct db_client *client, bool connected)
{
	const struct db_registers *registers = context;

	if (!connected)
		forget(registers, client);
	if (registers->ops->client)
		registers->ops->client(registers->context, client, connected);
}

const struct db_backend db_registers_backend = {
	.unit = backend_unit,
	.read = backend_read,
	.write = backend_write,
	.write_same = backend_write_same,
	.server_id = backend_server_id,
	.device_id = backend_device_id,
	.client = backend_client,
	.restricted = backend_restricted,
};

/* --- what comes back from the buses ---------------------------------------------------------------- */

/* Null: it has left. */
static struct view_drive *find_drive(const struct db_registers *registers, uint16_t drive)
{
	const struct view_layout *layout = registers->layout;

	for (size_t i = 0; layout && i < layout->drive_count; i++) {
		if (layout->drives[i]->drive == drive)
			return layout->drives[i];
	}
	return NULL;
}

void db_registers_complete(struct db_registers *registers, const struct db_completion *completion,
                           db_time now)
{
	struct view_drive *drive = find_drive(registers, db_ticket_drive(completion->ticket));

	if (!drive)
		return;
	/* First what the group's figures need: the commander may answer its writer. */
	group_completed(registers, drive, completion->ticket, completion->sent);
	db_commander_complete(drive->commander, completion, now);
	vsmd_view_completed(drive, completion, now);
}

db_time db_registers_next_deadline(struct db_registers *registers)
{
	const struct view_layout *layout = registers->layout;
	db_time next = DB_TIME_NEVER;

	for (size_t i = 0; i < layout->drive_count; i++) {
		db_time deadline = db_commander_next_deadline(layout->drives[i]->commander);

		if (deadline < next)
			next = deadline;
	}
	registers->due = next;
	return next;
}

void db_registers_expire(struct db_registers *registers, db_time now)
{
	const struct view_layout *layout = registers->layout;

	registers->due = DB_TIME_NEVER;
	for (size_t i = 0; i < layout->drive_count; i++) {
		const struct view_drive *drive = layout->drives[i];

		if (db_commander_expire(drive->commander, now) && registers->ops->tripped)
			registers->ops->tripped(registers->context, drive->bus, drive->config,
			                        &drive->fed_by);
	}
}

/* --- making ------------------------------------------------------------------------------------------ */

static int init_map(struct view_map *map, const struct db_scope *scope)
{
	map->driver = scope->driver;
	if (db_index_init(&map->holding, scope, DB_TABLE_HOLDING) != 0 ||
	    db_index_init(&map->discrete, scope, DB_TABLE_DISCRETE) != 0 ||
	    db_index_init(&map->coils, scope, DB_TABLE_COILS) != 0)
		return -ENOMEM;
	return 0;
}

static void release_map(struct view_map *map)
{
	db_index_release(&map->holding);
	db_index_release(&map->discrete);
	db_index_release(&map->coils);
}

/* The family's tables, made when its first drive comes. Null when out of memory. */
static const struct view_map *family_of(struct db_registers *registers,
                                        const struct db_driver *driver)
{
	struct db_scope scope = { .view = DB_VIEW_DRIVE, .driver = driver };
	struct view_map *map = registers->families;

	while (map && map->driver != driver)
		map = map->next;
	if (map)
		return map;
	map = calloc(1, sizeof *map);
	if (map && init_map(map, &scope) != 0) {
		release_map(map);
		free(map);
		return NULL;
	}
	if (map) {
		map->next = registers->families;
		registers->families = map;
	}
	return map;
}

static bool submit_to_bus(void *context, const struct db_request *request)
{
	const struct view_drive *drive = context;
	const struct db_registers *registers = drive->registers;

	vsmd_view_submitted(drive->vendor, request);
	return registers->ops->submit(registers->context, drive->line, request);
}

static void answer_client(void *context, struct db_write_token token, enum db_result result)
{
	const struct view_drive *drive = context;
	const struct db_registers *registers = drive->registers;

	if (group_answered(drive->registers, token, result))
		return;
	if (vsmd_view_answered(drive->vendor, token, &result))
		registers->ops->answer(registers->context, token, db_exception_of(result));
}

static uint64_t wall_us_now(void *context)
{
	const struct db_registers *registers = ((const struct view_drive *)context)->registers;

	return registers->ops->wall_us(registers->context);
}

static void tell_refused(void *context, const struct db_client *client,
                         const struct db_refused_write *write)
{
	const struct view_drive *drive = context;
	const struct db_registers *registers = drive->registers;

	if (registers->ops->write_refused)
		registers->ops->write_refused(registers->context, drive->bus, drive->config, client,
		                              write);
}

static const struct db_commander_ops commander_ops = {
	.submit = submit_to_bus,
	.answer = answer_client,
	.wall_us = wall_us_now,
	.refused = tell_refused,
};

/* A second or ten cycles, and at least three rounds over all the drives of a slow bus. */
static db_time useless_after(const struct db_roster *roster, size_t bus)
{
	const struct db_bus_config *config = roster->buses[bus].config;
	db_time age = 10 * (db_time)config->cycle_ms * DB_NS_PER_MS;
	db_time round = 0;

	/* By the time on the wire; what drives need beside shows in the rounds, see image.c. */
	for (size_t i = 0; i < roster->drive_count; i++) {
		if (roster->drives[i].bus == bus)
			round += config->driver->poll_time(config);
	}
	if (age < 3 * round)
		age = 3 * round;
	return age > DB_NS_PER_S ? age : DB_NS_PER_S;
}

static int make_parts(struct view_drive *drive, const struct view_drive *neighbour)
{
	struct db_commander_config commander = {
		.driver = drive->driver,
		.bus_config = drive->bus,
		.drive_config = drive->config,
		.neighbour = neighbour ? neighbour->commander : NULL,
		.commands = db_driver_commands(drive->bus, drive->config),
		.axis = drive->axis,
		.drive = drive->drive,
		.watchdog_ms = drive->config->watchdog_ms,
		.on_client_loss = db_on_loss_command(drive->config->on_client_loss),
	};

	drive->capabilities = db_capabilities(commander.commands, drive->driver->measures);
	drive->map = family_of(drive->registers, drive->driver);
	if (!drive->map)
		return -ENOMEM;
	if (drive->config->vendor_layout || drive->config->vendor_unit != 0) {
		drive->vendor = vsmd_view_new(drive->config);
		if (!drive->vendor)
			return -ENOMEM;
	}
	return db_commander_new(&commander, &commander_ops, drive, &drive->commander);
}

static void free_drive(struct view_drive *drive)
{
	if (!drive)
		return;
	db_commander_free(drive->commander);
	vsmd_view_free(drive->vendor);
	free(drive);
}

/* Another drive on this bus; null: there is none yet. */
static const struct view_drive *drive_on(const struct view_layout *layout,
                                         const struct db_bus_config *bus)
{
	for (size_t i = 0; layout && i < layout->drive_count; i++) {
		if (layout->drives[i]->bus == bus)
			return layout->drives[i];
	}
	return NULL;
}

/* Without what may change while it is there; see settle(). `layout` has those that were made before.
 * Null when out of memory. */
static struct view_drive *new_drive(struct db_registers *registers, const struct db_roster *roster,
                                    const struct db_roster_drive *member,
                                    const struct view_layout *layout)
{
	const struct db_bus_config *bus = roster->buses[member->bus].config;
	const struct view_drive *neighbour = drive_on(registers->layout, bus);
	struct view_drive *drive = calloc(1, sizeof *drive);

	if (!drive)
		return NULL;
	drive->registers = registers;
	drive->drive = member->drive;
	drive->config = member->config;
	drive->axis = member->axis;
	drive->bus = bus;
	drive->line = roster->buses[member->bus].bus;
	drive->driver = drive->bus->driver;
	drive->fresh_for = 3 * (db_time)drive->bus->cycle_ms * DB_NS_PER_MS;
	if (drive->fresh_for < 100 * DB_NS_PER_MS)
		drive->fresh_for = 100 * DB_NS_PER_MS;
	if (!neighbour)
		neighbour = drive_on(layout, bus);
	if (make_parts(drive, neighbour) == 0)
		return drive;
	free_drive(drive);
	return NULL;
}

/* --- rosters ----------------------------------------------------------------------------------------- */

struct db_registers_change {
	struct view_layout *layout;
	/* What the drives of the layout are given with it. */
	struct place {
		bool made; /* it is new */
		size_t bus;
		db_time useless_after;
	} * places;
};

static void free_layout(struct view_layout *layout)
{
	if (!layout)
		return;
	release_map(&layout->gateway);
	free(layout->buses);
	free(layout->drives);
	free(layout);
}

static void init_units(struct view_layout *layout)
{
	for (size_t i = 0; i < 256; i++)
		layout->units[i] = VIEW_NOTHING;
	for (size_t i = 0; i < layout->drive_count; i++) {
		const struct db_drive_config *drive = layout->drives[i]->config;

		layout->units[drive->unit & 0xFF] = (uint16_t)i;
		layout->vendor_units[drive->unit & 0xFF] = drive->vendor_layout;
		if (drive->vendor_unit != 0) {
			layout->units[drive->vendor_unit & 0xFF] = (uint16_t)i;
			layout->vendor_units[drive->vendor_unit & 0xFF] = true;
		}
	}
	layout->units[0] = VIEW_GATEWAY;
	layout->units[255] = VIEW_GATEWAY;
	layout->units[layout->modbus->gateway_unit & 0xFF] = VIEW_GATEWAY;
}

/* So that settle() need not ask for memory. */
static int reserve_writers(const struct view_layout *layout)
{
	bool by_client = layout->modbus->command_id_scope == DB_IDS_OF_CLIENT;

	for (size_t i = 0; i < layout->drive_count; i++) {
		if (db_commander_reserve(layout->drives[i]->commander, by_client) != 0)
			return -ENOMEM;
	}
	return 0;
}

static int fill_layout(struct db_registers *registers, const struct db_roster *roster,
                       struct db_registers_change *change)
{
	struct view_layout *layout = change->layout;

	for (; layout->bus_count < roster->bus_count; layout->bus_count++)
		layout->buses[layout->bus_count] = roster->buses[layout->bus_count].bus;
	for (; layout->drive_count < roster->drive_count; layout->drive_count++) {
		size_t i = layout->drive_count;
		const struct db_roster_drive *member = &roster->drives[i];
		struct view_drive *drive = find_drive(registers, member->drive);

		change->places[i] = (struct place){
			.made = !drive,
			.bus = member->bus,
			.useless_after = useless_after(roster, member->bus),
		};
		if (!drive)
			drive = new_drive(registers, roster, member, layout);
		if (!drive)
			return -ENOMEM;
		layout->drives[i] = drive;
	}
	init_units(layout);
	return reserve_writers(layout);
}

int db_registers_prepare(struct db_registers *registers, const struct db_roster *roster,
                         struct db_registers_change **change)
{
	struct db_scope scope = {
		.view = DB_VIEW_GATEWAY,
		.buses = roster->bus_count,
		.drives = roster->drive_count,
	};
	struct db_registers_change *made = calloc(1, sizeof *made);
	struct view_layout *layout = calloc(1, sizeof *layout);

	if (!made || !layout) {
		free(made);
		free(layout);
		return -ENOMEM;
	}
	/* One more of each than needed, so that none is ever an allocation of nothing. */
	made->layout = layout;
	made->places = calloc(roster->drive_count + 1, sizeof made->places[0]);
	layout->modbus = roster->modbus;
	layout->buses = calloc(roster->bus_count + 1, sizeof(struct db_bus *));
	layout->drives = calloc(roster->drive_count + 1, sizeof(struct view_drive *));
	if (!made->places || !layout->buses || !layout->drives ||
	    init_map(&layout->gateway, &scope) != 0 || fill_layout(registers, roster, made) != 0) {
		db_registers_change_free(made);
		return -ENOMEM;
	}
	*change = made;
	return 0;
}

void db_registers_change_free(struct db_registers_change *change)
{
	if (!change)
		return;
	for (size_t i = 0; i < change->layout->drive_count; i++) {
		if (change->places[i].made)
			free_drive(change->layout->drives[i]);
	}
	free_layout(change->layout);
	free(change->places);
	free(change);
}

static bool has_drive(const struct view_layout *layout, const struct view_drive *drive)
{
	for (size_t i = 0; i < layout->drive_count; i++) {
		if (layout->drives[i] == drive)
			return true;
	}
	return false;
}

void db_registers_retire(struct db_registers *registers, const struct db_registers_change *change)
{
	struct view_layout *layout = registers->layout;

	for (size_t i = 0; i < layout->drive_count; i++)
		layout->drives[i]->leaving = !has_drive(change->layout, layout->drives[i]);
	for (size_t unit = 0; unit < 256; unit++) {
		size_t place = layout->units[unit];

		if (place < layout->drive_count && layout->drives[place]->leaving)
			layout->units[unit] = VIEW_NOTHING;
	}
}

/* Gives a drive what comes with its layout. */
static void settle(struct view_drive *drive, const struct db_modbus_config *modbus,
                   const struct place *place)
{
	bool control = modbus->control == DB_CONTROL_DRIVE;

	drive->bus_place = place->bus;
	drive->useless_after = place->useless_after;
	db_commander_set_writers(drive->commander, modbus->confirm_ms, modbus->accept_writes,
	                         modbus->command_id_scope == DB_IDS_OF_CLIENT);
	if (place->made)
		db_control_init(&drive->control, control, modbus->control_timeout_ms);
	else
		db_control_change(&drive->control, control, modbus->control_timeout_ms);
}

void db_registers_apply(struct db_registers *registers, struct db_registers_change *change)
{
	struct view_layout *old = registers->layout;
	struct view_layout *layout = change->layout;

	for (size_t i = 0; i < layout->drive_count; i++) {
		settle(layout->drives[i], layout->modbus, &change->places[i]);
		change->places[i].made = false;
	}
	registers->layout = layout;
	/* Last: who is answered may come with its next request at once. */
	for (size_t i = 0; old && i < old->drive_count; i++) {
		if (has_drive(layout, old->drives[i]))
			continue;
		db_commander_dismiss(old->drives[i]->commander);
		free_drive(old->drives[i]);
	}
	free_layout(old);
	free(change->places);
	free(change);
}

int db_registers_new(const struct db_roster *roster, const struct db_registers_ops *ops,
                     void *context, struct db_registers **registers)
{
	struct db_registers *made = calloc(1, sizeof *made);
	struct db_registers_change *change;

	if (!made)
		return -ENOMEM;
	made->ops = ops;
	made->context = context;
	made->started = ops->now(context);
	made->due = DB_TIME_NEVER;
	if (db_registers_prepare(made, roster, &change) != 0) {
		db_registers_free(made);
		return -ENOMEM;
	}
	db_registers_apply(made, change);
	*registers = made;
	return 0;
}

void db_registers_free(struct db_registers *registers)
{
	struct view_map *family;

	if (!registers)
		return;
	for (size_t i = 0; registers->layout && i < registers->layout->drive_count; i++)
		free_drive(registers->layout->drives[i]);
	free_layout(registers->layout);
	while ((family = registers->families) != NULL) {
		registers->families = family->next;
		release_map(family);
		free(family);
	}
	free(registers);
}
