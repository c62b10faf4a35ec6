/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The schedule of a bus with each family's driver against hostile drives, in made-up time: drives
 * that are simulated, whose answers the input loses, delays, damages, doubles and invents, while
 * commands, stops, changes of the bus and losses of the port come at any moment.
 *
 * What must hold: the engine always wants to be called later than now, and not for ever at once, which
 * fake_pass() sees to; on a serial line nothing is sent while an answer may come; nothing is sent into a port that is down or
 * holds; what is sent is a request that the family's document knows; a stop is on the wire within
 * STOP_BOUND and is never answered "busy"; every request ends exactly once; and when the drives behave
 * again, everything that waits ends and every drive is online.
 */
#include "config/config_private.h"
#include "fakes/bus.h"
#include "line.h"
#include "sched/change.h"

#define MS DB_NS_PER_MS
#define S DB_NS_PER_S

#define TICKETS 96
#define STEPS_MAX 60
#define COMMANDS 8 /* requests */

/* A stop waits for at most the exchange on the wire; to a drive that is silent, for its share. */
#define STOP_BOUND (6 * S)
/* So long may drives that behave again need to be online, and requests to end. */
#define PATIENCE (180 * S)

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

/* One of the bus's drives, on it or not. */
struct place {
	bool there;
	bool leaving;
	db_time stop_since; /* when a stop began to wait for being sent; 0: none does */
};

struct ticket {
	bool open;
	bool stop;
	size_t place;
};

struct world {
	struct fake_bus *bus;
	struct line line;
	struct place places[LINE_DRIVES];
	uint16_t last_number;
	struct ticket tickets[TICKETS];
	size_t ticket_count;
	bool changing;
	bool up;
	bool held;
	bool wrote_settings; /* a drive may have another address since */
	bool ending;
	db_time silent_until; /* serial: nothing may be sent unless something came */
	unsigned doubled;     /* so many chunks are to come twice */
	unsigned swallowed;   /* so many not at all */
};

/* Read once: what no input changes. */
static const struct db_config *config_of(enum family family)
{
	static struct db_config *configs[FAMILIES];

	if (!configs[family])
		must(db_load_text(&db_load_built_in, line_configs[family], "f", stderr,
		                  &configs[family]) == 0);
	return configs[family];
}

/* --- the engine's surroundings --------------------------------------------------------------------- */

static void note_said(struct world *world, const struct said *said)
{
	for (size_t i = 0; i < LINE_DRIVES; i++) {
		if (said->stop && (said->address == LINE_ALL ||
		                   said->address == world->bus->list[i].config->address))
			world->places[i].stop_since = 0;
	}
}

static db_time on_send(void *context, const uint8_t *bytes, size_t length)
{
	struct world *world = context;
	const struct db_bus_config *config = &world->bus->config;
	size_t step = world->line.can ? sizeof(struct db_can_frame) : length;
	struct said said = { .address = LINE_ALL };

	must(world->up && !world->held && length > 0);
	must(world->line.can || world->bus->now >= world->silent_until);
	for (size_t at = 0; at < length; at += step) {
		said = line_read(&world->line, bytes + at, step);
		note_said(world, &said);
	}
	/* Nobody answers what everybody is told. */
	world->silent_until = world->bus->now +
	                      config->transport->wire_time(config, bytes, length, 0);
	if (said.address != LINE_ALL)
		world->silent_until += (db_time)config->drive_latency_ms * MS;
	line_hear(&world->line, bytes, length, world->bus->now);
	return world->bus->now;
}

static void on_tell(void *context, const struct db_drive_config *drive, enum db_event event,
                    const struct db_feedback *feedback, const struct db_outage *outage)
{
	(void)outage;
	(void)context;
	(void)event;
	must(drive && feedback);
}

static const struct db_engine_ops ops = { .send = on_send, .on_event = on_tell };

static void collect(struct world *world)
{
	struct db_request completion;

	while (fake_collect(world->bus->queue, &completion)) {
		struct ticket *ticket = &world->tickets[completion.ticket - 1];

		must(completion.ticket >= 1 && completion.ticket <= world->ticket_count);
		must(ticket->open);
		must(completion.result != DB_RESULT_NONE && completion.result != DB_RESULT_PENDING);
		must(!ticket->stop || completion.result != DB_RESULT_BUSY);
		ticket->open = false;
		if (ticket->stop)
			world->places[ticket->place].stop_since = 0;
	}
}

static void take_changed(struct world *world)
{
	struct db_change *changed = change_fetch(world->bus->engine);

	if (!changed)
		return;
	must(world->changing);
	world->changing = false;
	change_free(changed);
	for (size_t i = 0; i < LINE_DRIVES; i++) {
		if (!world->places[i].leaving)
			continue;
		world->places[i].leaving = world->places[i].there = false;
		world->places[i].stop_since = 0;
	}
}

static void check_stops(const struct world *world)
{
	for (size_t i = 0; i < LINE_DRIVES; i++) {
		const struct place *place = &world->places[i];

		must(place->stop_since == 0 || !world->up || world->held ||
		     world->bus->now - place->stop_since < STOP_BOUND);
	}
}

static void hand_over(struct world *world, const uint8_t *bytes, size_t length)
{
	if (!world->up)
		return;
	world->silent_until = world->bus->now;
	fake_receive(world->bus, bytes, length);
}

static void deliver(void *context)
{
	struct world *world = context;
	uint8_t bytes[256];
	size_t length;

	while ((length = line_say(&world->line, world->bus->now, bytes, sizeof bytes)) > 0) {
		if (world->swallowed > 0) {
			world->swallowed--;
			continue;
		}
		hand_over(world, bytes, length);
		if (world->doubled > 0) {
			world->doubled--;
			hand_over(world, bytes, length);
		}
	}
}

static void check_turn(void *context)
{
	struct world *world = context;

	collect(world);
	take_changed(world);
	check_stops(world);
}

static db_time line_speaks_at(void *context)
{
	return line_next(&((struct world *)context)->line);
}

/* --- what the input decides -------------------------------------------------------------------------- */

static uint16_t new_number(struct world *world)
{
	return ++world->last_number;
}

static void set_port(struct world *world, bool up)
{
	/* It cannot be opened again before it was lost. */
	if (up && world->up)
		return;
	world->up = up;
	world->held = false;
	world->silent_until = world->bus->now;
	for (size_t i = 0; i < LINE_DRIVES; i++) {
		if (world->places[i].stop_since != 0)
			world->places[i].stop_since = world->bus->now;
	}
	fake_port(world->bus, up ? 0 : 5);
}

static void set_held(struct world *world, bool held)
{
	if (!world->up)
		return;
	world->held = held;
	for (size_t i = 0; i < LINE_DRIVES; i++) {
		if (world->places[i].stop_since != 0)
			world->places[i].stop_since = world->bus->now;
	}
	db_engine_hold(world->bus->engine, held, world->bus->now);
}

static struct db_args read_args(struct input *input)
{
	return (struct db_args){
		.target_position = (int32_t)input_u32(input),
		.target_velocity = (float)(int16_t)input_u16(input),
		.output_number = (uint16_t)(1 + input_u8(input) % 8),
		.output_value = input_u8(input) & 1,
		.shake_end_position = 100,
		.shake_frequency = 1.0f,
		.shake_cycles = 2,
		.target_current = 0.5f,
		.program_number = 1,
	};
}

static void post_ticket(struct world *world, struct db_request *request, size_t place)
{
	bool stop = request->setting_count == 0 && db_command_is_stop(request->command);

	if (world->ticket_count == TICKETS)
		return;
	request->ticket = (uint32_t)world->ticket_count + 1;
	request->drive = world->bus->list[place].drive;
	request->submitted = world->bus->now;
	if (!db_queue_post(world->bus->queue, request))
		return;
	world->tickets[world->ticket_count++] = (struct ticket){ true, stop, place };
	if (stop && world->places[place].there && world->places[place].stop_since == 0)
		world->places[place].stop_since = world->bus->now;
}

/* As the commander does, only what the driver has found possible. */
static void command(struct world *world, struct input *input)
{
	size_t place = input_below(input, LINE_DRIVES);
	enum db_command code = input_u8(input) % DB_CMD_LIMIT;
	struct db_args args = read_args(input);
	struct db_request request = { .command = code, .args = &args };
	const struct db_bus_config *bus = &world->bus->config;
	const struct db_drive_config *drive = world->bus->list[place].config;

	if (!(db_driver_commands(bus, drive) & DB_COMMAND_BIT(request.command)) ||
	    (bus->driver->check && bus->driver->check(bus, drive, code, &args) != DB_RESULT_OK))
		return;
	post_ticket(world, &request, place);
}

static void stop(struct world *world, struct input *input)
{
	static const enum db_command stops[] = { DB_CMD_STOP, DB_CMD_QUICK_STOP, DB_CMD_DISABLE };
	uint8_t which = input_u8(input);
	struct db_request request = { .command = stops[which % 3] };

	post_ticket(world, &request, which / 3 % LINE_DRIVES);
}

static void stop_all(struct world *world)
{
	for (size_t i = 0; i < LINE_DRIVES; i++) {
		struct db_request request = { .command = DB_CMD_STOP };

		post_ticket(world, &request, i);
	}
}

static void write_settings(struct world *world, struct input *input)
{
	size_t place = input_below(input, LINE_DRIVES);
	size_t wanted = 1 + input_below(input, 4);
	struct db_setting settings[4];
	struct db_request request = { .settings = settings };
	const struct db_bus_config *bus = &world->bus->config;

	for (size_t i = 0; i < wanted; i++) {
		struct db_setting *setting = &settings[request.setting_count];

		*setting = (struct db_setting){
			.param = (uint16_t)input_below(input, bus->driver->param_count + 1),
			.value = { .u = input_u32(input) },
		};
		if (db_driver_check_param(bus, setting->param, setting->value) == DB_RESULT_OK)
			request.setting_count++;
	}
	if (request.setting_count == 0)
		return;
	world->wrote_settings = true;
	post_ticket(world, &request, place);
}

/* Some leave, and whoever is not there comes. */
static void change(struct world *world, struct input *input)
{
	uint8_t choice = input_u8(input);
	struct db_bus_drive coming[LINE_DRIVES];
	uint16_t leaving[LINE_DRIVES];
	size_t leaving_count = 0;
	size_t coming_count = 0;
	struct db_change *made;

	if (world->changing || world->ending)
		return;
	for (size_t i = 0; i < LINE_DRIVES; i++) {
		struct place *place = &world->places[i];
		struct db_bus_drive *drive = &world->bus->list[i];

		if (place->there && (choice >> i & 1)) {
			leaving[leaving_count++] = drive->drive;
			place->leaving = true;
		} else if (!place->there && (choice >> (i + 4) & 1)) {
			drive->drive = new_number(world);
			place->there = true;
			coming[coming_count++] = *drive;
		}
	}
	made = change_new(&world->bus->config, LINE_DRIVES, leaving, leaving_count, coming,
	                  coming_count);
	must(made);
	world->changing = true;
	change_begin(world->bus->engine, made, world->bus->now);
}

static void set_fault(struct world *world, struct input *input)
{
	uint8_t where = input_u8(input);
	size_t fault = input_below(input, SIM_FAULT_BUS_OFF);
	uint8_t times = input_u8(input);
	struct sim_faults *faults = line_faults(&world->line);

	if (where % 5 < LINE_DRIVES && fault != SIM_FAULT_ECHO)
		faults = &world->line.nodes[where % 5].faults;
	faults->left[fault] = times == 255 ? -1 : times % 8;
	faults->delay_ms = where;
}

/* What a drive never said: any bytes, or a frame with the right form. */
static void invent(struct world *world, struct input *input)
{
	const uint8_t *bytes;
	size_t length = input_bytes(input, 1 + input_u8(input) % 64, &bytes);
	struct db_can_frame frame = { .length = 8 };

	if (world->line.serial) {
		hand_over(world, bytes, length);
		return;
	}
	for (size_t at = 0; at + 13 <= length; at += 13) {
		memcpy(&frame.id, bytes + at, sizeof frame.id);
		frame.id &= ~(uint32_t)DB_CAN_ERROR;
		frame.length = bytes[at + 4] % 9;
		memcpy(frame.data, bytes + at + 5, sizeof frame.data);
		hand_over(world, (const uint8_t *)&frame, sizeof frame);
	}
}

static void tamper(struct world *world, struct input *input)
{
	uint8_t choice = input_u8(input);

	if (choice & 1)
		world->doubled = choice >> 4;
	else
		world->swallowed = choice >> 4;
}

static void wait_a_while(struct world *world, struct input *input)
{
	static const db_time units[] = { 50 * DB_NS_PER_US, MS, 3 * MS, 12 * MS };
	uint8_t choice = input_u8(input);

	fake_pass(world->bus, (1 + (choice & 0x3F)) * units[choice >> 6]);
}

static void act(struct world *world, struct input *input)
{
	switch (input_u8(input) % 16) {
	case 0:
	case 1:
	case 2:
		command(world, input);
		break;
	case 3:
		stop(world, input);
		break;
	case 4:
		stop_all(world);
		break;
	case 5:
		write_settings(world, input);
		break;
	case 6:
		change(world, input);
		break;
	case 7:
		set_port(world, input_u8(input) & 1);
		break;
	case 8:
		set_held(world, input_u8(input) & 1);
		break;
	case 9:
		line_power(&world->line, input_below(input, LINE_DRIVES), input_u8(input) & 1,
		           world->bus->now);
		break;
	case 10:
	case 11:
		set_fault(world, input);
		break;
	case 12:
		invent(world, input);
		break;
	case 13:
		tamper(world, input);
		break;
	default:
		wait_a_while(world, input);
		break;
	}
}

/* --- a whole story ----------------------------------------------------------------------------------- */

static void open_world(struct world *world, struct input *input)
{
	uint8_t choice = input_u8(input);
	size_t count = 1 + (choice >> 2) % LINE_DRIVES;
	const struct db_config *config = config_of(choice % FAMILIES);
	struct fake_bus *bus = fake_bus_new(config->buses[0].driver, LINE_DRIVES);

	*world = (struct world){ .bus = bus };
	bus->config = config->buses[0];
	bus->config.queue = COMMANDS;
	bus->context = world;
	bus->next = line_speaks_at;
	bus->happen = deliver;
	bus->turned = check_turn;
	line_open(&world->line, choice % FAMILIES, &bus->config, LINE_DRIVES, 0, bus->now);
	for (size_t i = 0; i < LINE_DRIVES; i++) {
		bus->list[i].drive = new_number(world);
		bus->list[i].config = &config->drives[i];
		world->places[i].there = i < count;
	}
	fake_bus_open(bus, count, &ops);
	set_port(world, true);
}

static void close_world(struct world *world)
{
	fake_bus_free(world->bus);
	line_close(&world->line);
}

static bool all_ended(const struct world *world)
{
	for (size_t i = 0; i < world->ticket_count; i++) {
		if (world->tickets[i].open)
			return false;
	}
	return !world->changing;
}

static bool all_online(const struct world *world)
{
	for (size_t i = 0; i < LINE_DRIVES; i++) {
		if (world->places[i].there && !fake_is_online(world->bus, i))
			return false;
	}
	return true;
}

/* The drives behave, and nobody disturbs them. */
static void recover(struct world *world)
{
	db_time end = world->bus->now + PATIENCE;

	world->doubled = world->swallowed = 0;
	line_mend(&world->line, world->bus->now);
	if (!world->up)
		set_port(world, true);
	if (world->held)
		set_held(world, false);
	while (!all_ended(world) || !(world->wrote_settings || all_online(world))) {
		must(world->bus->now < end);
		fake_pass(world->bus, 100 * MS);
	}
}

/* Quiet in time, or given up as the bus's thread does. */
static void shut_down(struct world *world)
{
	db_time end = world->bus->now + DB_EXIT_TIME;

	world->ending = true;
	db_engine_shut_down(world->bus->engine, world->bus->now);
	while (!db_engine_is_quiet(world->bus->engine, false) && world->bus->now < end)
		fake_pass(world->bus, 20 * MS);
	db_engine_report_unconfirmed(world->bus->engine);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
	struct input input = { data, size };
	static struct world world;

	open_world(&world, &input);
	for (unsigned i = 0; i < STEPS_MAX && input.left > 0; i++)
		act(&world, &input);
	recover(&world);
	shut_down(&world);
	close_world(&world);
	return 0;
}
