/* SPDX-License-Identifier: Apache-2.0 */
#include "regmap/view.h"

#include "drivebridge/version.h"
#include "regmap/vsmd_view.h"
#include "regmap/words.h"

#include <errno.h>
#include <modbus.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

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
	uint16_t low; /* offsets of the first and the last member of the image that is read */
	uint16_t high;
};

static uint8_t find_span(const struct db_index *index, enum db_table table, uint16_t address,
                         uint16_t count, struct span *span)
{
	uint16_t first = db_index_find(index, address, count, &span->count);

	if (first == DB_NO_CELL)
		return MODBUS_EXCEPTION_ILLEGAL_DATA_ADDRESS;
	span->cells = &index->cells[first];
	span->parts = 0;
	span->flags = 0;
	span->low = span->high = span->cells[0].offset;
	for (uint16_t i = 0; i < span->count; i++) {
		span->parts |= span->cells[i].part;
		span->flags |= span->cells[i].flags;
		if (span->cells[i].offset < span->low)
			span->low = span->cells[i].offset;
		if (span->cells[i].offset > span->high)
			span->high = span->cells[i].offset;
	}
	if (table == DB_TABLE_INPUT && (span->flags & DB_ROW_WRITABLE))
		return MODBUS_EXCEPTION_ILLEGAL_DATA_ADDRESS;
	return 0;
}

static void copy_registers(const struct span *span, const void *image, bool low_first,
                           uint16_t address, uint16_t count, uint16_t *values)
{
	uint16_t done = 0;

	for (uint16_t i = 0; i < span->count; i++) {
		const struct db_cell *cell = &span->cells[i];
		uint16_t words[DB_CELL_REGISTERS_MAX];
		uint16_t from;
		uint16_t take;

		/* Whole cells, nearly always, go straight to their place. */
		if (cell->address == address + done && cell->registers <= count - done) {
			db_words_encode(cell, image, low_first, &values[done]);
			done = (uint16_t)(done + cell->registers);
			continue;
		}
		db_words_encode(cell, image, low_first, words);
		from = (uint16_t)(address + done - cell->address);
		take = (uint16_t)(cell->registers - from);
		if (take > count - done)
			take = (uint16_t)(count - done);
		memcpy(&values[done], &words[from], take * sizeof words[0]);
		done = (uint16_t)(done + take);
	}
}

static void copy_bits(const struct span *span, const void *image, uint16_t *values)
{
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
		values[i] = (uint16_t)(wide >> cell->bit & 1);
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
	if (drive->registers->config->modbus.stale_values)
		return 0;
	if (!(feedback->status & DB_STATUS_ONLINE) || feedback->taken == 0)
		return view_unreachable(feedback);
	return 0;
}

static uint8_t check_params(const struct view_drive *drive, const struct span *span,
                            const struct db_drive_image *image)
{
	bool stale = drive->registers->config->modbus.stale_values;
	uint32_t wanted = DB_STATUS_ONLINE | DB_STATUS_PARAMS_VALID;
	bool fresh = (image->feedback.status & wanted) == wanted;

	for (uint16_t i = 0; i < span->count; i++) {
		const struct db_cell *cell = &span->cells[i];

		if (!(cell->flags & DB_ROW_PARAM))
			continue;
		if (image->plate.valid & (UINT64_C(1) << cell->param)) {
			if (fresh || stale)
				continue;
			return view_unreachable(&image->feedback);
		}
		/* All were read and this was not among them: this model has no such parameter. */
		return fresh ? MODBUS_EXCEPTION_ILLEGAL_DATA_ADDRESS :
		               view_unreachable(&image->feedback);
	}
	return 0;
}

static void fill_control(struct db_drive_image *image, const struct view_drive *drive,
                         const struct db_client *client)
{
	db_time now = drive->registers->ops->now(drive->registers->context);
	const struct db_client *holder = db_control_holder(&drive->control, now);

	image->control_request = holder && holder->id == client->id;
	image->control_port = holder ? holder->port : 0;
	image->control_holder = holder ? view_ipv4(holder->address) : 0;
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
		copy_registers(&span, &image, drive->registers->config->modbus.low_word_first,
		               address, count, values);
	else
		copy_bits(&span, &image, values);
	return 0;
}

static uint8_t read_gateway(const struct db_registers *registers, const struct db_client *client,
                            enum db_table table, uint16_t address, uint16_t count, uint16_t *values)
{
	struct db_gateway_image image;
	struct span span;
	uint8_t exception = find_span(table_of(&registers->gateway, table), table, address, count,
	                              &span);

	if (exception)
		return exception;
	view_fill_gateway(&image, registers, client, span.parts, span.low, span.high);
	copy_registers(&span, &image, registers->config->modbus.low_word_first, address, count,
	               values);
	return 0;
}

/* --- the backend ----------------------------------------------------------------------------------- */

/* Null for the gateway. Only asked for units that exist. */
static struct view_drive *drive_of(const struct db_registers *registers, uint8_t unit)
{
	uint16_t drive = registers->units[unit];

	return drive < registers->drive_count ? &registers->drives[drive] : NULL;
}

static uint8_t backend_unit(void *context, uint8_t unit)
{
	const struct db_registers *registers = context;

	return registers->units[unit] == VIEW_NOTHING ? MODBUS_EXCEPTION_GATEWAY_PATH : 0;
}

/* Who may only look does not keep a machine running, nor who does not control it. */
static void feed(struct view_drive *drive, const struct db_client *client, enum db_watchdog_feed by)
{
	const struct db_registers *registers = drive->registers;
	db_time now = registers->ops->now(registers->context);

	db_commander_hear(drive->commander, client, now);
	if (!client->may_write || !db_control_holds(&drive->control, client, now))
		return;
	db_control_hear(&drive->control, client, now);
	db_commander_feed(drive->commander, by, now);
	drive->fed_by = *client;
}

static uint8_t backend_read(void *context, const struct db_client *client, uint8_t unit,
                            enum db_table table, uint16_t address, uint16_t count, uint16_t *values)
{
	const struct db_registers *registers = context;
	struct view_drive *drive = drive_of(registers, unit);

	if (drive) {
		feed(drive, client, DB_FEED_REQUESTS);
		if (registers->vendor_units[unit])
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
		feed(drive, client, DB_FEED_WRITES);
		if (drive->registers->vendor_units[unit])
			return vsmd_view_write(drive, client, table, address, count, values, token);
		return view_write(drive, client, table, address, count, values, token);
	}
	if (backend_unit(context, unit))
		return MODBUS_EXCEPTION_GATEWAY_PATH;
	return view_write_gateway(context, client, table, address, count, values, token);
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

static const char *model_of(struct view_drive *drive)
{
	struct db_nameplate plate;

	db_axis_read_nameplate(drive->axis, &plate);
	if (plate.identity[0] == '\0')
		return drive->driver->title;
	memcpy(drive->model, plate.identity, sizeof plate.identity);
	drive->model[sizeof plate.identity] = '\0';
	return drive->model;
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

static void backend_client(void *context, const struct db_client *client, bool connected)
{
	const struct db_registers *registers = context;

	for (size_t i = 0; i < registers->drive_count && !connected; i++)
		db_control_release(&registers->drives[i].control, client);
	if (registers->ops->client)
		registers->ops->client(registers->context, client, connected);
}

const struct db_backend db_registers_backend = {
	.unit = backend_unit,
	.read = backend_read,
	.write = backend_write,
	.server_id = backend_server_id,
	.device_id = backend_device_id,
	.client = backend_client,
};

/* --- what comes back from the buses ---------------------------------------------------------------- */

void db_registers_complete(struct db_registers *registers, const struct db_completion *completion,
                           db_time now)
{
	uint16_t drive = db_ticket_drive(completion->ticket);

	if (drive >= registers->drive_count)
		return;
	/* First what the group's figures need: the commander may answer its writer. */
	group_completed(registers, &registers->drives[drive], completion->ticket, completion->sent);
	db_commander_complete(registers->drives[drive].commander, completion, now);
	vsmd_view_completed(&registers->drives[drive], completion, now);
}

db_time db_registers_next_deadline(const struct db_registers *registers)
{
	db_time next = DB_TIME_NEVER;

	for (size_t i = 0; i < registers->drive_count; i++) {
		db_time deadline = db_commander_next_deadline(registers->drives[i].commander);

		if (deadline < next)
			next = deadline;
	}
	return next;
}

void db_registers_expire(struct db_registers *registers, db_time now)
{
	for (size_t i = 0; i < registers->drive_count; i++) {
		const struct view_drive *drive = &registers->drives[i];

		if (db_commander_expire(drive->commander, now) && registers->ops->tripped)
			registers->ops->tripped(registers->context, i, &drive->fed_by);
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

	for (size_t i = 0; i < registers->family_count; i++) {
		if (registers->families[i].driver == driver)
			return &registers->families[i];
	}
	/* Counted first, so that what a failed one allocated is released, too. */
	registers->family_count++;
	if (init_map(&registers->families[registers->family_count - 1], &scope) != 0)
		return NULL;
	return &registers->families[registers->family_count - 1];
}

static bool submit_to_bus(void *context, const struct db_request *request)
{
	const struct view_drive *drive = context;
	const struct db_registers *registers = drive->registers;

	vsmd_view_submitted(drive->vendor, request);
	return registers->ops->submit(registers->context, drive->config->bus, request);
}

static void answer_client(void *context, struct db_write_token token, uint8_t exception)
{
	const struct view_drive *drive = context;
	const struct db_registers *registers = drive->registers;

	if (group_answered(drive->registers, token, exception))
		return;
	if (vsmd_view_answered(drive->vendor, token, &exception))
		registers->ops->answer(registers->context, token, exception);
}

static uint64_t wall_us_now(void *context)
{
	const struct db_registers *registers = ((const struct view_drive *)context)->registers;

	return registers->ops->wall_us(registers->context);
}

static const struct db_commander_ops commander_ops = {
	.submit = submit_to_bus,
	.answer = answer_client,
	.wall_us = wall_us_now,
};

/* Its place among the drives of its bus. */
static uint16_t bus_axis_of(const struct db_config *config, size_t drive)
{
	uint16_t before = 0;

	for (size_t i = 0; i < drive; i++) {
		if (config->drives[i].bus == config->drives[drive].bus)
			before++;
	}
	return before;
}

/* A second or ten cycles, and at least three rounds over all the drives of a slow bus. */
static db_time useless_after(const struct db_config *config, const struct view_drive *drive)
{
	db_time age = 10 * (db_time)drive->bus->cycle_ms * DB_NS_PER_MS;
	db_time round = 0;

	for (size_t i = 0; i < config->drive_count; i++) {
		if (config->drives[i].bus == drive->config->bus)
			round += drive->driver->poll_time(drive->bus);
	}
	if (age < 3 * round)
		age = 3 * round;
	return age > DB_NS_PER_S ? age : DB_NS_PER_S;
}

static int init_drive(struct db_registers *registers, size_t number, struct db_axis *axis)
{
	const struct db_config *config = registers->config;
	struct view_drive *drive = &registers->drives[number];
	struct db_commander_config commander = {
		.axis = axis,
		.drive = (uint16_t)number,
		.bus_axis = bus_axis_of(config, number),
		.confirm_ms = config->modbus.confirm_ms,
		.accept_writes = config->modbus.accept_writes,
		.ids_by_client = config->modbus.command_id_scope == DB_IDS_OF_CLIENT,
		.watchdog_ms = config->drives[number].watchdog_ms,
		.on_client_loss = db_on_loss_command(config->drives[number].on_client_loss),
	};

	drive->registers = registers;
	drive->config = &config->drives[number];
	drive->bus = &config->buses[drive->config->bus];
	drive->driver = drive->bus->driver;
	drive->axis = axis;
	db_control_init(&drive->control, config->modbus.control == DB_CONTROL_DRIVE,
	                config->modbus.control_timeout_ms);
	commander.bus_config = drive->bus;
	commander.drive_config = drive->config;
	commander.commands = db_driver_commands(drive->bus, drive->config);
	drive->capabilities = db_capabilities(commander.commands, drive->driver->measures);
	drive->fresh_for = 3 * (db_time)drive->bus->cycle_ms * DB_NS_PER_MS;
	if (drive->fresh_for < 100 * DB_NS_PER_MS)
		drive->fresh_for = 100 * DB_NS_PER_MS;
	drive->useless_after = useless_after(config, drive);
	drive->map = family_of(registers, drive->driver);
	commander.driver = drive->driver;
	if (!drive->map)
		return -ENOMEM;
	if (drive->config->vendor_layout || drive->config->vendor_unit != 0) {
		drive->vendor = vsmd_view_new(drive->config);
		if (!drive->vendor)
			return -ENOMEM;
	}
	if (db_commander_new(&commander, &commander_ops, drive, &drive->commander) == 0)
		return 0;
	vsmd_view_free(drive->vendor);
	return -ENOMEM;
}

static void init_units(struct db_registers *registers)
{
	const struct db_config *config = registers->config;

	for (size_t i = 0; i < 256; i++)
		registers->units[i] = VIEW_NOTHING;
	for (size_t i = 0; i < config->drive_count; i++) {
		const struct db_drive_config *drive = &config->drives[i];

		registers->units[drive->unit & 0xFF] = (uint16_t)i;
		registers->vendor_units[drive->unit & 0xFF] = drive->vendor_layout;
		if (drive->vendor_unit != 0) {
			registers->units[drive->vendor_unit & 0xFF] = (uint16_t)i;
			registers->vendor_units[drive->vendor_unit & 0xFF] = true;
		}
	}
	registers->units[0] = VIEW_GATEWAY;
	registers->units[255] = VIEW_GATEWAY;
	registers->units[config->modbus.gateway_unit & 0xFF] = VIEW_GATEWAY;
}

int db_registers_new(const struct db_config *config, struct db_axis *const *axes,
                     const struct db_registers_ops *ops, void *context,
                     struct db_registers **registers)
{
	struct db_scope scope = {
		.view = DB_VIEW_GATEWAY,
		.buses = config->bus_count,
		.drives = config->drive_count,
	};
	struct db_registers *made = calloc(1, sizeof *made);

	if (!made)
		return -ENOMEM;
	made->config = config;
	made->ops = ops;
	made->context = context;
	made->started = ops->now(context);
	made->families = calloc(config->bus_count + 1, sizeof made->families[0]);
	made->drives = calloc(config->drive_count + 1, sizeof made->drives[0]);
	if (!made->families || !made->drives || init_map(&made->gateway, &scope) != 0)
		goto fail;
	for (; made->drive_count < config->drive_count; made->drive_count++) {
		if (init_drive(made, made->drive_count, axes[made->drive_count]) != 0)
			goto fail;
	}
	init_units(made);
	*registers = made;
	return 0;
fail:
	db_registers_free(made);
	return -ENOMEM;
}

void db_registers_free(struct db_registers *registers)
{
	if (!registers)
		return;
	for (size_t i = 0; i < registers->drive_count; i++) {
		db_commander_free(registers->drives[i].commander);
		vsmd_view_free(registers->drives[i].vendor);
	}
	for (size_t i = 0; i < registers->family_count; i++)
		release_map(&registers->families[i]);
	release_map(&registers->gateway);
	free(registers->families);
	free(registers->drives);
	free(registers);
}
