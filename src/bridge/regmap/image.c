/* SPDX-License-Identifier: Apache-2.0 */
#include "regmap/image.h"

#include "drivebridge/scale.h"
#include "drivebridge/trouble.h"
#include "drivebridge/version.h"
#include "regmap/clients.h"
#include "regmap/regmap_private.h"

#include <errno.h>
#include <string.h>

/* Status bits that are not set by the bus. */
#define NET_BITS (DB_STATUS_BUSY | DB_STATUS_LATCHED | DB_STATUS_DONE | DB_STATUS_ABORTED)

/* The bus thread may publish after the clock was read and before the data: the data are never newer
 * than now. */
static db_time age_of(const struct db_feedback *feedback, db_time now)
{
	return now > feedback->taken ? now - feedback->taken : 0;
}

static uint32_t age_ms(const struct db_feedback *feedback, db_time now)
{
	db_time age = age_of(feedback, now) / DB_NS_PER_MS;

	return feedback->taken == 0 || age > UINT32_MAX ? UINT32_MAX : (uint32_t)age;
}

/* Milliseconds since it began, at least 1: 0 says that there is nothing. */
static uint32_t lasting_ms(bool any, db_time since, db_time now)
{
	db_time lasted = now > since ? (now - since) / DB_NS_PER_MS : 0;

	if (!any)
		return 0;
	return lasted == 0 ? 1 : lasted > UINT32_MAX ? UINT32_MAX : (uint32_t)lasted;
}

/* The interval at which the drive is read. */
static db_time interval_of(const struct db_snapshot *snapshot)
{
	return (db_time)snapshot->stats.poll_interval_us * DB_NS_PER_US;
}

/* After this number of intervals without a sample a drive counts as not answering. */
#define USELESS_INTERVALS 10

/*
 * A drive that answers everything but its status in time, or a bus that does not get round to
 * polling it: whatever the reason, data this old is useless. So is that of a drive that is being
 * removed.
 */
static void drop_if_too_old(struct db_feedback *feedback, const struct db_view_drive *drive,
                            db_time interval, db_time now)
{
	const struct db_registers *registers = drive->registers;
	db_time age = age_of(feedback, now);
	struct db_bus_stats stats;

	if (!drive->leaving) {
		if (!(feedback->status & DB_STATUS_ONLINE) || age <= drive->useless_after)
			return;
		/* At least three current rounds over the bus: drives that respond slowly, each
		 * within drive-latency-ms, make them longer than the wire does. */
		registers->ops->bus_stats(registers->context, drive->bus, &stats);
		if (age <= 3 * (db_time)stats.cycle_us * DB_NS_PER_US ||
		    age <= USELESS_INTERVALS * interval)
			return;
	}
	feedback->status &= DB_STATUS_BUS_UP | DB_STATUS_MUST_STAND;
	feedback->state = DB_AXIS_OFFLINE;
	feedback->error = DB_ERROR_NO_ANSWER;
}

/* A sample is valid for this number of the intervals at which its drive is read, and at least for
 * this time: a computer that is busy for some milliseconds is no fault of the drive. */
#define FRESH_INTERVALS 3
#define FRESH_AT_LEAST (100 * DB_NS_PER_MS)

static uint16_t quality_of(const struct db_view_drive *drive, const struct db_snapshot *snapshot,
                           const struct db_feedback *feedback, db_time now)
{
	db_time fresh;

	if (feedback->taken == 0)
		return DB_QUALITY_BAD;
	if (!(feedback->status & DB_STATUS_ONLINE))
		return drive->registers->roster->modbus->stale_values ? DB_QUALITY_UNCERTAIN :
		                                                        DB_QUALITY_BAD;
	if (feedback->doubt != DB_DOUBT_NONE || now < snapshot->trouble.uncertain_until)
		return DB_QUALITY_UNCERTAIN;
	fresh = FRESH_INTERVALS * interval_of(snapshot);
	if (fresh < FRESH_AT_LEAST)
		fresh = FRESH_AT_LEAST;
	return age_of(feedback, now) <= fresh ? DB_QUALITY_GOOD : DB_QUALITY_UNCERTAIN;
}

/* Combines what the bus knows with what it does not: the watchdog, and the age of its data. */
static struct db_trouble judge_trouble(const struct db_snapshot *snapshot,
                                       const struct db_feedback *shown,
                                       const struct db_command_state *state, db_time now)
{
	enum db_trouble_cause known = (enum db_trouble_cause)snapshot->trouble.cause;
	struct db_trouble trouble = snapshot->trouble;
	const struct db_trouble_signs signs = {
		.silence = known == DB_TROUBLE_NOT_UNDERSTOOD || known == DB_TROUBLE_LATE ||
		                           known == DB_TROUBLE_DEAF ?
		                   known :
		                   DB_TROUBLE_NO_ANSWER,
		.aside = known == DB_TROUBLE_ASIDE,
		.two_drives = known == DB_TROUBLE_TWO_DRIVES,
		.stands_late = db_trouble_stands_late(&snapshot->must_stand, now),
		.latched = state->latched,
	};

	trouble.cause = (uint16_t)db_trouble_of(shown, &signs);
	if (trouble.cause == DB_TROUBLE_WATCHDOG)
		trouble.since = state->latched_since;
	else if (trouble.cause == DB_TROUBLE_MUST_STAND)
		trouble.since = snapshot->must_stand.since;
	else if (trouble.cause != snapshot->trouble.cause)
		trouble.since = shown->taken;
	return trouble;
}

static void fill_process(struct db_drive_image *image, const struct db_view_drive *drive,
                         const struct db_client *client)
{
	const struct db_feedback *feedback = &image->feedback;
	double counts_per_unit;
	struct db_snapshot snapshot;
	db_time now;

	db_axis_read(drive->axis, &snapshot);
	now = drive->registers->ops->now(drive->registers->context);
	image->feedback = snapshot.feedback;
	counts_per_unit = db_scale_counts(drive->config, feedback);
	drop_if_too_old(&image->feedback, drive, interval_of(&snapshot), now);
	image->stats = snapshot.stats;
	image->learnt = snapshot.learnt;
	image->must_stand = snapshot.must_stand;
	image->must_stand_cause = snapshot.must_stand.cause;
	image->must_stand_ms = lasting_ms(snapshot.must_stand.cause != DB_STAND_FREE,
	                                  snapshot.must_stand.since, now);
	db_commander_state(drive->commander, client, &image->state, now);
	image->quality = quality_of(drive, &snapshot, feedback, now);
	image->age_ms = age_ms(feedback, now);
	image->poll_interval_ms = (snapshot.stats.poll_interval_us + 999) / 1000;
	image->status = feedback->status & ~(uint32_t)NET_BITS;
	if (image->state.latched) {
		image->status |= DB_STATUS_LATCHED;
		if (feedback->error == DB_ERROR_NONE)
			image->feedback.error = DB_ERROR_CLIENT_LOSS;
	}
	if (image->state.busy)
		image->status |= DB_STATUS_BUSY;
	if (image->state.results.done)
		image->status |= DB_STATUS_DONE;
	if (image->state.results.aborted)
		image->status |= DB_STATUS_ABORTED;
	image->trouble = judge_trouble(&snapshot, feedback, &image->state, now);
	image->trouble_ms = lasting_ms(image->trouble.cause != DB_TROUBLE_NONE,
	                               image->trouble.since, now);
	image->position_units = (float)((double)feedback->position / counts_per_unit);
	image->velocity_units = (float)((double)feedback->velocity *
	                                db_driver_velocity_counts(drive->driver, drive->config) /
	                                counts_per_unit);
	image->capabilities = drive->capabilities;
	image->heartbeat = drive->heartbeat.value;
}

/* The elements of an array in the image, `size` each, that lie between two offsets: *from <= i <
 * *to. */
static void find_touched(size_t array, size_t size, uint16_t low, uint16_t high, size_t count,
                         size_t *from, size_t *to)
{
	*from = low > array ? (low - array) / size : 0;
	*to = high < array ? 0 : (high - array) / size + 1;
	if (*to > count)
		*to = count;
}

/* The register of a vendor's parameter; 0: unknown. */
static uint16_t param_address(const struct db_view_drive *drive, uint16_t param)
{
	const struct db_index *index = &drive->map->holding;
	unsigned first = db_param_first(drive->driver);

	for (size_t i = 0; i < index->count; i++) {
		const struct db_cell *cell = &index->cells[i];

		if (cell->address >= first && (cell->flags & DB_ROW_PARAM) && cell->param == param)
			return cell->address;
	}
	return 0;
}

void db_image_name_client(const struct db_registers *registers, const uint8_t address[16],
                          char shown[2 * DB_CLIENT_ADDRESS_REGISTERS],
                          char user[2 * DB_CLIENT_USER_REGISTERS])
{
	char brief[DB_CLIENT_ADDRESS_MAX];
	char *role;
	struct db_client_words words;

	if (registers->ops->client_words)
		registers->ops->client_words(registers->context, address, &words);
	else
		db_client_words_init(&words, address, "", "");
	/* A truncated name could be another client's; show the certificate without its role, else
	 * the address. */
	role = strstr(words.address, ", role ");
	if (strlen(words.address) > (size_t)2 * DB_CLIENT_ADDRESS_REGISTERS && role)
		*role = '\0';
	if (strlen(words.address) > (size_t)2 * DB_CLIENT_ADDRESS_REGISTERS) {
		db_client_address(address, brief);
		strcpy(words.address, brief);
	}
	memcpy(shown, words.address,
	       strnlen(words.address, (size_t)2 * DB_CLIENT_ADDRESS_REGISTERS));
	memcpy(user, words.user, strnlen(words.user, (size_t)2 * DB_CLIENT_USER_REGISTERS));
}

static void fill_history(struct db_drive_history *shown, const struct db_view_drive *drive,
                         size_t age)
{
	const struct db_history_entry *entry = &shown->entry;

	memset(shown, 0, sizeof(*shown));
	if (!db_commander_history(drive->commander, age, &shown->entry))
		return;
	if (entry->command == DB_CMD_NONE)
		shown->entry.number = param_address(drive, entry->number);
	if (entry->port == 0)
		return; /* the bridge itself */
	shown->ipv4 = db_client_ipv4(entry->address);
	db_image_name_client(drive->registers, entry->address, shown->address, shown->user);
}

void db_image_fill_drive(struct db_drive_image *image, const struct db_view_drive *drive,
                         const struct db_client *client, unsigned parts, uint16_t low,
                         uint16_t high)
{
	size_t from;
	size_t to;

	if (parts & (DB_PART_PROCESS | DB_PART_PLATE))
		fill_process(image, drive, client);
	/* Read after the snapshot: when the snapshot says that the parameters are valid, these
	 * are. */
	if (parts & DB_PART_PLATE)
		db_axis_read_nameplate(drive->axis, &image->nameplate);
	if (parts & DB_PART_BLOCK)
		image->block = db_commander_kept(drive->commander, client);
	if (parts & DB_PART_STATIC) {
		const char *unit = db_scale_unit(drive->driver, drive->config);
		size_t length = strlen(unit);
		struct db_snapshot snapshot;

		if (length > sizeof(image->unit_name))
			length = sizeof(image->unit_name);
		memset(image->unit_name, 0, sizeof(image->unit_name));
		memcpy(image->unit_name, unit, length);
		image->bus = (uint16_t)(drive->bus_index + 1);
		image->address = (uint16_t)drive->config->address;
		db_axis_read(drive->axis, &snapshot);
		image->counts_per_unit = (float)db_scale_counts(drive->config, &snapshot.feedback);
	}
	if (!(parts & DB_PART_HISTORY))
		return;
	find_touched(offsetof(struct db_drive_image, history), sizeof(image->history[0]), low, high,
	             DB_HISTORY_MAX, &from, &to);
	for (size_t i = from; i < to; i++)
		fill_history(&image->history[i], drive, i);
}

/* Buses count their drives themselves; those of an endpoint may be a part of each bus's. */
static uint16_t count_online(const struct db_registers *registers,
                             const struct db_view_space *space)
{
	const struct db_view_roster *roster = registers->roster;
	unsigned online = 0;

	for (size_t i = 0; roster->space_count == 1 && i < roster->bus_count; i++) {
		struct db_bus_stats bus;

		registers->ops->bus_stats(registers->context, roster->buses[i], &bus);
		online += bus.online;
	}
	for (size_t i = 0; roster->space_count > 1 && i < space->drive_count; i++) {
		struct db_snapshot snapshot;

		db_axis_read(space->drives[i]->axis, &snapshot);
		online += (snapshot.feedback.status & DB_STATUS_ONLINE) != 0;
	}
	return (uint16_t)online;
}

static void fill_server(struct db_gateway_image *image, const struct db_registers *registers,
                        const struct db_view_space *space)
{
	const struct db_view_roster *roster = registers->roster;
	db_time up = registers->ops->now(registers->context) - registers->started;
	struct db_configuration_report report;
	size_t length;

	registers->ops->server_stats(registers->context, &image->server);
	image->version_major = DB_VERSION_MAJOR;
	image->version_minor = DB_VERSION_MINOR;
	image->version_patch = DB_VERSION_PATCH;
	image->bus_count = (uint16_t)roster->bus_count;
	image->drive_count = (uint16_t)space->drive_count;
	image->drives_online = count_online(registers, space);
	image->uptime_s = (uint32_t)(up / DB_NS_PER_S);
	report = (struct db_configuration_report){ .messages = "", .replaced = "" };
	if (registers->ops->configuration)
		report = registers->ops->configuration(registers->context);
	image->configuration_state = (uint16_t)report.state;
	image->configuration_since_us = report.since_us;
	/* Only the first message. */
	length = strcspn(report.messages, "\n");
	if (length > sizeof(image->configuration_message))
		length = sizeof(image->configuration_message);
	memset(image->configuration_message, 0, sizeof(image->configuration_message));
	memcpy(image->configuration_message, report.messages, length);
}

static void fill_group(struct db_gateway_image *image, const struct db_view_space *space)
{
	const struct db_group *group = &space->own->group;

	image->heartbeat = space->own->heartbeat;
	image->group_stop = 0;
	image->group_start = 0;
	image->group_staged = 0;
	for (size_t i = 0; i < space->drive_count; i++) {
		const struct db_view_drive *drive = space->drives[i];

		if (!drive->leaving && db_commander_staged(drive->commander) != DB_CMD_NONE)
			image->group_staged++;
	}
	image->group_drives = group->drives;
	image->group_result = group->result;
	image->group_busy = group->pending > 0;
	image->group_skew_us = group->skew_us;
	memcpy(image->group_units, group->units, sizeof(image->group_units));
	image->group_stop_units = 0;
}

static void fill_gateway_drive(struct db_gateway_drive *image, const struct db_view_drive *drive,
                               db_time now)
{
	struct db_snapshot snapshot;

	db_axis_read(drive->axis, &snapshot);
	drop_if_too_old(&snapshot.feedback, drive, interval_of(&snapshot), now);
	*image = (struct db_gateway_drive){
		.unit = (uint16_t)drive->config->unit,
		.online = (snapshot.feedback.status & DB_STATUS_ONLINE) != 0,
		.axis_state = snapshot.feedback.state,
		.error = snapshot.feedback.error,
		.age_ms = age_ms(&snapshot.feedback, now),
		.stats = snapshot.stats,
	};
}

static void fill_window(struct db_gateway_window *window, const struct db_view_drive *drive,
                        const struct db_client *client)
{
	struct db_drive_image image;
	const struct db_feedback *feedback = &image.feedback;

	fill_process(&image, drive, client);
	*window = (struct db_gateway_window){
		.unit = (uint16_t)drive->config->unit,
		.online = (image.status & DB_STATUS_ONLINE) != 0,
		.axis_state = feedback->state,
		.error = feedback->error,
		.status = image.status,
		.quality = image.quality,
		.active_command = image.state.active_command,
		.age_ms = image.age_ms,
		.position = feedback->position,
		.velocity = feedback->velocity,
		.position_units = image.position_units,
		.velocity_units = image.velocity_units,
		.drive_status = feedback->drive_status,
		.result_id = image.state.results.result_id,
		.result = image.state.results.result,
		.inputs = feedback->inputs,
		.outputs = feedback->outputs,
	};
}

static void fill_clients(struct db_gateway_image *image, const struct db_registers *registers,
                         const struct db_view_space *space)
{
	struct db_server_client clients[DB_GATEWAY_CLIENTS];
	db_time now = registers->ops->now(registers->context);
	size_t count = 0;

	if (registers->ops->server_clients)
		count = registers->ops->server_clients(registers->context, clients,
		                                       DB_GATEWAY_CLIENTS);
	memset(image->connected, 0, sizeof(image->connected));
	for (size_t i = 0; i < count; i++) {
		struct db_gateway_client *shown = &image->connected[i];
		char user[2 * DB_CLIENT_USER_REGISTERS];

		shown->ipv4 = db_client_ipv4(clients[i].client.address);
		shown->port = clients[i].client.port;
		shown->may_write = clients[i].client.may_write;
		shown->requests = (uint32_t)clients[i].requests;
		shown->idle_s = (uint32_t)(clients[i].idle / DB_NS_PER_S);
		shown->connected_s = (uint32_t)(clients[i].connected / DB_NS_PER_S);
		/* The drives that it controls, as far as they have a bit. */
		shown->controls = 0;
		for (size_t k = 0; k < space->drive_count && k < DB_GATEWAY_DRIVES; k++) {
			const struct db_client *holder = db_control_holder(
				&space->drives[k]->control, now);

			if (holder && holder->id == clients[i].client.id)
				shown->controls |= UINT32_C(1) << k;
		}
		db_image_name_client(registers, clients[i].client.address, shown->address, user);
	}
}

void db_image_fill_bus(struct db_gateway_bus *bus, const struct db_registers *registers,
                       size_t place)
{
	const struct db_port_health *port = &bus->stats.port;
	unsigned line = 0;

	registers->ops->bus_stats(registers->context, registers->roster->buses[place], &bus->stats);
	bus->up = bus->stats.up;
	bus->last_error = (uint16_t)bus->stats.last_error;
	if (bus->stats.up && port->up)
		line |= DB_LINE_UP;
	if (port->error == ENETRESET)
		line |= DB_LINE_BUS_OFF;
	if (port->error_passive)
		line |= DB_LINE_PASSIVE;
	if (port->error_warning)
		line |= DB_LINE_WARNING;
	bus->line_state = (uint16_t)line;
	bus->line_error = (uint16_t)port->error;
}

void db_image_fill_gateway(struct db_gateway_image *image, const struct db_registers *registers,
                           const struct db_view_space *space, const struct db_client *client,
                           unsigned parts, uint16_t low, uint16_t high)
{
	size_t from;
	size_t to;

	if (parts & DB_PART_SERVER)
		fill_server(image, registers, space);
	if (parts & DB_PART_GROUP)
		fill_group(image, space);
	if (parts & DB_PART_CLIENTS)
		fill_clients(image, registers, space);
	if (parts & DB_PART_BUSES) {
		find_touched(offsetof(struct db_gateway_image, buses), sizeof(image->buses[0]), low,
		             high, registers->roster->bus_count, &from, &to);
		for (size_t i = from; i < to && i < DB_GATEWAY_BUSES; i++)
			db_image_fill_bus(&image->buses[i], registers, i);
	}
	if (parts & DB_PART_DRIVES) {
		db_time now = registers->ops->now(registers->context);

		find_touched(offsetof(struct db_gateway_image, drives), sizeof(image->drives[0]),
		             low, high, space->drive_count, &from, &to);
		for (size_t i = from; i < to && i < DB_GATEWAY_DRIVES; i++) {
			const struct db_view_drive *drive = space->drives[i];

			if (db_clients_are_permitted(drive, client, DB_MAY_READ))
				fill_gateway_drive(&image->drives[i], drive, now);
			else
				memset(&image->drives[i], 0, sizeof(image->drives[i]));
		}
	}
	if (parts & DB_PART_WINDOWS) {
		find_touched(offsetof(struct db_gateway_image, windows), sizeof(image->windows[0]),
		             low, high, space->drive_count, &from, &to);
		for (size_t i = from; i < to && i < DB_GATEWAY_WINDOWS; i++) {
			const struct db_view_drive *drive = space->drives[i];

			if (db_clients_are_permitted(drive, client, DB_MAY_READ))
				fill_window(&image->windows[i], drive, client);
			else
				memset(&image->windows[i], 0, sizeof(image->windows[i]));
		}
	}
}
