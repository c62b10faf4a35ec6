/* SPDX-License-Identifier: Apache-2.0 */
#include "sim/sim_config.h"

#include "codec/servo_can_layout.h"
#include "codec/slcan.h"
#include "codec/vsmd_serial.h"
#include "reader/source.h"
#include "sim/config_section.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static db_time read_ms(const struct sim_section *section, const char *name)
{
	return sim_section_whole(section, name) * DB_NS_PER_MS;
}

static db_time read_us(const struct sim_section *section, const char *name)
{
	return sim_section_whole(section, name) * DB_NS_PER_US;
}

static void read_faults(const struct sim_section *section, const char **faults, size_t *count)
{
	const char *text = NULL;

	if (sim_section_length(section, "fault") > SIM_FAULT_TEXTS_MAX) {
		sim_section_refuse(section, "fault", "more than %d faults", SIM_FAULT_TEXTS_MAX);
		return;
	}
	while ((text = sim_section_next(section, "fault", text)) != NULL) {
		struct sim_faults scratch = { .delay_ms = 0 };
		const char *error = sim_faults_set(&scratch, text);

		if (error)
			sim_section_refuse(section, "fault", "fault \"%s\": %s", text, error);
		faults[(*count)++] = text;
	}
}

/* --- buses ------------------------------------------------------------------------------------ */

static void read_number_frame(const struct sim_section *section,
                              struct servo_can_number_layout *frame, const char *name)
{
	char key[40];

	snprintf(key, sizeof(key), "%s-base", name);
	frame->base = (uint16_t)sim_section_whole(section, key);
	frame->set = frame->base > 0;
	snprintf(key, sizeof(key), "%s-length", name);
	frame->length = (uint8_t)sim_section_whole(section, key);
	snprintf(key, sizeof(key), "%s-ack", name);
	frame->ack = (uint8_t)sim_section_whole(section, key);
	snprintf(key, sizeof(key), "%s-fixed", name);
	servo_can_put_number_fixed(frame, (uint64_t)sim_section_whole(section, key));
}

/* What the servos' document leaves open. */
static void read_servo_layout(const struct sim_section *section, struct servo_can_layout *layout)
{
	struct servo_can_words_layout *words = &layout->words;
	size_t errors = section->messages->errors;
	enum servo_can_described which;
	char reason[SERVO_CAN_REASON_MAX];

	layout->ack_base = (uint16_t)sim_section_whole(section, "ack-base");
	layout->padded = sim_section_flag(section, "padded");
	words->base = (uint16_t)sim_section_whole(section, "command-word-base");
	words->set = words->base > 0;
	words->length = (uint8_t)sim_section_whole(section, "command-word-length");
	words->word0 = (uint8_t)sim_section_whole(section, "command-word-0-at");
	/* -1 becomes SERVO_CAN_NO_WORD. */
	words->word1 = (uint8_t)sim_section_whole(section, "command-word-1-at");
	words->ack = (uint8_t)sim_section_whole(section, "command-word-ack");
	servo_can_put_fixed(words, (uint64_t)sim_section_whole(section, "command-word-fixed"));
	/* Settings with one number each. */
	layout->move.at = (uint8_t)sim_section_whole(section, "move-frame-at");
	layout->move.size = (uint8_t)sim_section_whole(section, "move-frame-bytes");
	layout->move.low_first = sim_section_word(section, "move-frame-order") == 1;
	read_number_frame(section, &layout->move, "move-frame");
	layout->word1.size = sizeof(uint16_t);
	if (sim_section_whole(section, "command-word-1-base") > 0) {
		layout->word1.at = (uint8_t)sim_section_whole(section, "command-word-1-at");
		layout->words.word1 = SERVO_CAN_NO_WORD;
	}
	read_number_frame(section, &layout->word1, "command-word-1");
	layout->slot = (uint8_t)sim_section_whole(section, "position-slot");
	layout->slot_base = (uint16_t)sim_section_whole(section, "position-slot-base");
	layout->slot_ack = (uint8_t)sim_section_whole(section, "position-slot-ack");
	if (section->messages->errors == errors &&
	    servo_can_layout_check(layout, &which, reason) != SERVO_CAN_OK)
		sim_section_refuse(section, "command-word-base", "frames cannot be so: %s", reason);
}

static void read_can(const struct sim_section *section, struct sim_bus_config *bus)
{
	bool adapter = sim_section_word(section, "transport") == 0;
	long bitrate = sim_section_whole(section, "bitrate");

	if (adapter && slcan_bitrate_digit((uint32_t)bitrate) < 0)
		sim_section_refuse(section, "bitrate",
		                   "bitrate = %ld cannot be set on a serial adapter; one of these "
		                   "is right: 10000, 20000, 50000, 100000, 125000, 250000, 500000, "
		                   "800000, 1000000",
		                   bitrate);
	else if (bus->kind == SIM_BUS_VSMD_CAN && vsmd_can_rate_code((uint32_t)bitrate) == 0)
		sim_section_refuse(section, "bitrate",
		                   "bitrate = %ld is none these drives have; 100000, 125000, "
		                   "250000, 500000 and 1000000, for instance, are right",
		                   bitrate);
	if (!adapter)
		bus->interface = sim_section_text(section, "interface");
	if (!adapter && !bus->interface)
		sim_section_refuse(section, "transport",
		                   "transport = socketcan needs interface = NAME, such as vcan0");
	bus->can = (struct sim_can_config){
		.bitrate = (unsigned)bitrate,
		.adapter = adapter,
		.latency = bus->serial.latency,
	};
	bus->style = (struct vsmd_can_style){
		.extended = sim_section_word(section, "frames") == 0,
		.output_base = (uint8_t)sim_section_whole(section, "output-base"),
	};
}

static void read_bus(const struct sim_section *section, struct sim_bus_config *bus)
{
	bus->name = section->title;
	bus->kind = (enum sim_bus_kind)sim_section_word(section, "protocol");
	bus->device = sim_section_text(section, "device");
	bus->link = sim_section_text(section, "link");
	bus->flash = sim_section_text(section, "flash");
	bus->follows_host = sim_section_flag(section, "follow-host");
	bus->serial = (struct sim_serial_config){
		.baud = (unsigned)sim_section_whole(section, "baud"),
		.rs485 = sim_section_word(section, "line") == 0,
		/* A real line takes its own time, a pty (whichever program made it) takes none. */
		.paced = strcmp(bus->device, "pty") == 0 ||
		         strncmp(bus->device, "/dev/pts/", 9) == 0,
		.reply_id = (uint8_t)sim_section_whole(section, "reply-id"),
		.twins = (enum sim_twins)sim_section_word(section, "twins"),
		.latency = read_us(section, "latency-us"),
		.turnaround = read_us(section, "turnaround-us"),
		.line_hold = read_us(section, "line-hold-us"),
	};
	if (bus->kind == SIM_BUS_VSMD_CAN || bus->kind == SIM_BUS_SERVO_CAN)
		read_can(section, bus);
	if (bus->kind == SIM_BUS_SERVO_CAN)
		read_servo_layout(section, &bus->layout);
	read_faults(section, bus->faults, &bus->fault_count);
}

/* --- VSMD drives ------------------------------------------------------------------------------ */

static bool read_position(const char *text, double *position, const char **end)
{
	char *stop;

	*position = strtod(text, &stop);
	*end = stop;
	return stop != text && isfinite(*position);
}

/* "2:above:50000", "1:between:-10:10" */
static bool parse_sensor(const char *text, struct sim_sensor *sensors)
{
	struct sim_sensor sensor = { .kind = SIM_SENSOR_NONE };
	unsigned number = (unsigned)(text[0] - '0');
	const char *rest;

	if (number < 1 || number > SIM_VSMD_SENSORS || text[1] != ':')
		return false;
	rest = text + 2;
	if (strncmp(rest, "below:", 6) == 0)
		sensor.kind = SIM_SENSOR_BELOW;
	else if (strncmp(rest, "above:", 6) == 0)
		sensor.kind = SIM_SENSOR_ABOVE;
	else if (strncmp(rest, "between:", 8) == 0)
		sensor.kind = SIM_SENSOR_BETWEEN;
	else
		return false;
	rest = strchr(rest, ':') + 1;
	if (!read_position(rest, &sensor.low, &rest))
		return false;
	if (sensor.kind == SIM_SENSOR_BETWEEN &&
	    (*rest != ':' || !read_position(rest + 1, &sensor.high, &rest) ||
	     sensor.high < sensor.low))
		return false;
	sensors[number - 1] = sensor;
	return *rest == '\0';
}

static void read_vsmd_settings(const struct sim_section *section, struct sim_vsmd_config *vsmd)
{
	const char *text = NULL;

	while ((text = sim_section_next(section, "set", text)) != NULL) {
		struct vsmd_setting setting;
		size_t cursor = 0;

		if (vsmd_serial_next_param(text, strlen(text), &cursor, &setting) != 1) {
			sim_section_refuse(
				section, "set",
				"set \"%s\" cannot be read; right is NAME=VALUE with the "
				"vendor's name of a parameter",
				text);
		} else if (setting.param == VSMD_CID || setting.param == VSMD_BDR) {
			sim_section_refuse(
				section, "set",
				"set \"%s\": use address of the drive and baud of its bus", text);
		} else if (!sim_vsmd_takes(vsmd, setting.param, setting.value)) {
			const struct db_param *param = &vsmd_params[setting.param];

			sim_section_refuse(section, "set",
			                   "set \"%s\" is out of range or not for this model; "
			                   "%g to %g is documented",
			                   text, param->min, param->max);
		} else {
			vsmd->defaults[setting.param] = setting.value;
		}
	}
}

/* What the documents of VSMD drives leave open. */
static void read_vsmd_temper(const struct sim_section *section, struct sim_vsmd_temper *temper)
{
	const char *text = NULL;

	*temper = (struct sim_vsmd_temper){
		.handshake = (enum sim_handshake)sim_section_word(section, "handshake"),
		.keeps_handshake = sim_section_flag(section, "handshake-kept"),
		.handshake_lapses = read_ms(section, "handshake-lapses-ms"),
		.power_delay = read_ms(section, "power-delay-ms"),
		.standing_delay = read_ms(section, "standing-delay-ms"),
		.motion_delay = read_ms(section, "motion-delay-ms"),
		.refusal = (enum sim_refusal)sim_section_word(section, "refusal"),
		.clamps = sim_section_flag(section, "clamps"),
		.rests_off = (int32_t)sim_section_whole(section, "rests-off"),
		.trembles = (int32_t)sim_section_whole(section, "trembles"),
		.speed = (enum sim_speed)sim_section_word(section, "speed"),
		.mirrored = sim_section_flag(section, "mirrored"),
		.keeps_position = sim_section_flag(section, "keeps-position"),
		.coasts = sim_section_flag(section, "coasts"),
		.keeps_zero = sim_section_flag(section, "homing-bit-kept"),
		.settles = (enum sim_settles)sim_section_word(section, "settles"),
		.hides_outputs = sim_section_flag(section, "hides-outputs"),
		.ignores_broadcast = sim_section_flag(section, "ignores-broadcast"),
		.text = (enum sim_text_ends)sim_section_word(section, "text"),
		.numbers = (enum sim_numbers)sim_section_word(section, "numbers"),
		.parameters = (enum sim_parameters)sim_section_word(section, "parameters"),
		.capitals = sim_section_flag(section, "capitals"),
		.commas = sim_section_flag(section, "commas"),
		.text_length = (size_t)sim_section_whole(section, "text-length"),
		.answers = (enum sim_answers)sim_section_word(section, "answers"),
		.replies = (enum sim_replies)sim_section_word(section, "replies"),
		.read_max = (unsigned)sim_section_whole(section, "read-max"),
		.hides_identity = sim_section_flag(section, "hides-identity"),
	};
	if (sim_section_length(section, "lacks") > SIM_VSMD_LACKS_MAX) {
		sim_section_refuse(section, "lacks", "more than %d ranges", SIM_VSMD_LACKS_MAX);
		return;
	}
	while ((text = sim_section_next(section, "lacks", text)) != NULL) {
		if (!sim_registers_parse(text, &temper->lacks[temper->lacks_count++]))
			sim_section_refuse(
				section, "lacks",
				"lacks \"%s\" cannot be read; right is a register or a range "
				"in hexadecimal, \"0b\" or \"1c-2b\"",
				text);
	}
}

static void read_vsmd(const struct sim_section *section, const struct sim_bus_config *bus,
                      struct sim_vsmd_config *vsmd)
{
	static const unsigned model_numbers[] = { 10, 25, 45, 80 };
	static const enum vsmd_param currents[] = { VSMD_CRA, VSMD_CRN, VSMD_CRH, VSMD_ZCR };
	bool can = bus->kind == SIM_BUS_VSMD_CAN;
	long last = VSMD_SERIAL_ID_MAX;
	const char *text = NULL;

	if (can)
		last = bus->style.extended ? VSMD_CAN_DRIVE_MAX : VSMD_CAN_STD_DRIVE_MAX;
	if (!sim_section_check_range(section, "address", 1, last))
		return;
	sim_vsmd_config_init(vsmd, (unsigned)sim_section_whole(section, "address"),
	                     can ? bus->can.bitrate : bus->serial.baud);
	vsmd->can = can;
	vsmd->model = model_numbers[sim_section_word(section, "model")];
	vsmd->identity = sim_section_text(section, "identity");
	vsmd->closed_loop = sim_section_flag(section, "closed-loop");
	vsmd->external = sim_section_flag(section, "external");
	vsmd->max_current = sim_section_real(section, "max-current");
	vsmd->travel_min = sim_section_real(section, "travel-min");
	vsmd->travel_max = sim_section_real(section, "travel-max");
	vsmd->start = sim_section_real(section, "start");
	vsmd->defaults[VSMD_EMOD].u = vsmd->closed_loop;
	read_vsmd_temper(section, &vsmd->temper);
	if (strlen(vsmd->identity) >= SIM_VSMD_IDENTITY_MAX)
		sim_section_refuse(section, "identity", "identity is longer than %d characters",
		                   SIM_VSMD_IDENTITY_MAX - 1);
	if (!(vsmd->max_current > 0.0))
		sim_section_refuse(section, "max-current", "max-current must be above 0 (in A)");
	if (!(vsmd->travel_min <= vsmd->start && vsmd->start <= vsmd->travel_max))
		sim_section_refuse(section, "start",
		                   "start must lie between travel-min and travel-max");
	for (size_t i = 0; i < sizeof(currents) / sizeof(currents[0]); i++) {
		float *current = &vsmd->defaults[currents[i]].f;

		if ((double)*current > vsmd->max_current)
			*current = (float)vsmd->max_current;
	}
	while ((text = sim_section_next(section, "sensor", text)) != NULL) {
		if (!parse_sensor(text, vsmd->sensors))
			sim_section_refuse(section, "sensor",
			                   "sensor \"%s\" cannot be read; right is N:below:POS, "
			                   "N:above:POS or N:between:FROM:TO with N 1 to 6",
			                   text);
	}
	read_vsmd_settings(section, vsmd);
}

/* --- servos ----------------------------------------------------------------------------------- */

static double read_step(const struct sim_section *section, const char *name)
{
	double step = sim_section_real(section, name);

	if (step < 0 || step > 0)
		return step;
	sim_section_refuse(section, name, "%s must not be 0", name);
	return 1;
}

static void read_servo(const struct sim_section *section, struct sim_drive_config *drive)
{
	struct sim_servo_config *servo = &drive->servo;
	struct sim_servo_dialect *dialect = &servo->dialect;
	static const char *const intervals[SIM_SERVO_REPORTS] = {
		[SIM_SERVO_REPORT_POSITION] = "report-position-ms",
		[SIM_SERVO_REPORT_MOTION] = "report-motion-ms",
		[SIM_SERVO_REPORT_HEALTH] = "report-health-ms",
	};
	const char *places;

	if (!sim_section_check_range(section, "address", 1, SERVO_CAN_NODE_MAX))
		return;
	sim_servo_config_init(servo);
	for (size_t i = 0; i < SIM_SERVO_REPORTS; i++)
		servo->reports[i] = read_ms(section, intervals[i]);
	servo->mode = (enum servo_can_mode)sim_section_word(section, "mode");
	servo->synchronous = sim_section_flag(section, "sync");
	servo->start = sim_section_real(section, "start");
	servo->load = sim_section_real(section, "load");
	servo->inertia = sim_section_real(section, "inertia");
	if (!(servo->inertia > 0.0))
		sim_section_refuse(section, "inertia", "inertia must be above 0 (in kg m^2)");
	/* What the servos' document leaves open for one drive. */
	servo->temper = (struct sim_servo_temper){
		.fault_power = (enum sim_servo_fault_power)sim_section_word(section, "fault-power"),
		.demand = (enum sim_servo_demand)sim_section_word(section, "demand"),
		.reached_by_profile = sim_section_word(section, "reached-bit") == 1,
		.ignores_trigger = sim_section_word(section, "trigger") == 1,
		.counts_anew = sim_section_flag(section, "counts-anew"),
		.ignores_broadcast = sim_section_flag(section, "ignores-broadcast"),
		.deaf_to_setpoints = sim_section_word(section, "setpoints") == 1,
		.unsigned_speed = sim_section_word(section, "speed-sign") == 1,
		.zero_speed = sim_section_real(section, "zero-speed-rpm"),
		.dither = sim_section_real(section, "dither"),
		.motion_delay = read_ms(section, "motion-delay-ms"),
	};
	places = sim_section_text(section, "status-places");
	if (strlen(places) == SIM_SERVO_PLACES &&
	    strspn(places, "-0123456789abcdef") == SIM_SERVO_PLACES)
		memcpy(dialect->places, places, SIM_SERVO_PLACES + 1);
	else
		sim_section_refuse(section, "status-places",
		                   "status-places has 16 places, each 0 to f or -");
	dialect->inverted = (uint16_t)sim_section_whole(section, "status-inverted");
	dialect->moving_bit = (int)sim_section_whole(section, "moving-bit");
	dialect->mirrored = sim_section_flag(section, "mirrored");
	dialect->moves_relatively = sim_section_word(section, "moves") == 1;
	dialect->demand_step = read_step(section, "demand-step");
	dialect->move_step = read_step(section, "move-step");
	dialect->speed_step = read_step(section, "speed-step");
	dialect->setpoint_step = read_step(section, "setpoint-step");
	dialect->current_step = read_step(section, "current-step");
	dialect->current_setpoint_step = read_step(section, "current-setpoint-step");
	servo->power_time = read_ms(section, "power-ms");
	drive->servo_lengths = (enum sim_servo_lengths)sim_section_word(section, "answer-length");
	drive->servo_ack_latency = read_us(section, "ack-latency-us");
	drive->servo_stray_acks = sim_section_flag(section, "stray-acks");
}

/* --- XYZA controllers ------------------------------------------------------------------------- */

/* "lead.y=2000" for one axis, "lead=2000" for all, "sound=1" for a shared item. */
static bool parse_xyza_setting(const char *text, struct sim_xyza_config *xyza)
{
	static const char letters[] = "xyza";
	size_t length = strcspn(text, ".=");
	int param = xyza_param_find(text, length);
	const char *letter = NULL;
	union db_value value;
	char *end;
	double number;

	if (param < 0 || param == XYZA_FACTORY_RESET || param == XYZA_SLAVE_NUMBER)
		return false;
	text += length;
	if (*text == '.') {
		letter = text[1] ? strchr(letters, text[1]) : NULL;
		if (!letter || !xyza_item_of_axis(xyza_param_places[param].item))
			return false;
		text += 2;
	}
	if (*text != '=')
		return false;
	number = strtod(text + 1, &end);
	if (end == text + 1 || *end != '\0' ||
	    !db_value_from_number(xyza_params[param].type, number, &value) ||
	    !xyza_param_in_range((enum xyza_param)param, value))
		return false;
	for (size_t axis = 0; axis < XYZA_AXIS_COUNT; axis++) {
		uint32_t *content = &xyza->defaults[axis][xyza_param_places[param].item];

		if (!letter || letters[axis] == *letter)
			*content = xyza_param_put((enum xyza_param)param, value, *content);
	}
	return true;
}

/* What the manual of XYZA controllers leaves open. */
static void read_xyza_temper(const struct sim_section *section, struct sim_xyza_temper *temper)
{
	const char *text = NULL;

	*temper = (struct sim_xyza_temper){
		.no_negative_zero = !sim_section_flag(section, "negative-zero"),
		.amount_clears_sign = sim_section_flag(section, "amount-clears-sign"),
		.acknowledges_all = sim_section_flag(section, "acknowledges-all"),
		.clamps = sim_section_flag(section, "clamps"),
		.settles = (enum sim_settles)sim_section_word(section, "settles"),
		.jogs_from_stand = sim_section_flag(section, "jogs-from-stand"),
		.second_stop_ends = sim_section_flag(section, "second-stop-ends"),
		.ordered_speeds = sim_section_flag(section, "ordered-speeds"),
		.latches_speed = sim_section_flag(section, "latches-speed"),
		.takes_any = sim_section_flag(section, "takes-any"),
		.idle_state = (uint8_t)sim_section_whole(section, "idle-state"),
		.motion_delay = read_ms(section, "motion-delay-ms"),
		.standing_delay = read_ms(section, "standing-delay-ms"),
		.item_delay = read_ms(section, "power-delay-ms"),
		.braking = read_ms(section, "braking-ms"),
		.answers_as_host = sim_section_flag(section, "answers-as-host"),
	};
	while ((text = sim_section_next(section, "lacks", text)) != NULL) {
		int param = xyza_param_find(text, strlen(text));

		if (strcmp(text, "ports") == 0)
			temper->lacks_ports = true;
		else if (strcmp(text, "program") == 0)
			temper->lacks_program = true;
		else if (param < 0)
			sim_section_refuse(section, "lacks",
			                   "lacks \"%s\" is no parameter, nor ports nor program",
			                   text);
		else
			temper->lacks |= 1u << xyza_param_places[param].item;
	}
	while ((text = sim_section_next(section, "ignores", text)) != NULL) {
		unsigned kind = 0;

		while (sim_xyza_kinds[kind] && strcmp(text, sim_xyza_kinds[kind]) != 0)
			kind++;
		if (!sim_xyza_kinds[kind])
			sim_section_refuse(
				section, "ignores",
				"ignores \"%s\" is unknown; one of these is right: position, "
				"sign, item, output, jog, program",
				text);
		else
			temper->ignores |= 1u << kind;
	}
}

static void read_xyza(const struct sim_section *section, struct sim_xyza_config *xyza)
{
	const char *text = NULL;

	if (!sim_section_check_range(section, "address", 1, XYZA_OBJECT_MAX))
		return;
	sim_xyza_config_init(xyza, (unsigned)sim_section_whole(section, "address"));
	xyza->style.answer_mark_0a = sim_section_word(section, "answer-mark") == 1;
	xyza->style.failure_bb = sim_section_word(section, "failure-code") == 1;
	xyza->style.echo_a4 = sim_section_flag(section, "echo-a4");
	xyza->axes = (unsigned)sim_section_whole(section, "axes");
	xyza->programs = (unsigned)sim_section_whole(section, "programs");
	xyza->steps = (unsigned)sim_section_whole(section, "program-steps");
	xyza->step_time = read_ms(section, "step-ms");
	while ((text = sim_section_next(section, "set", text)) != NULL) {
		if (!parse_xyza_setting(text, xyza))
			sim_section_refuse(section, "set",
			                   "set \"%s\" cannot be read or is out of range; right is "
			                   "NAME=VALUE, or NAME.x=VALUE for one axis",
			                   text);
	}
	read_xyza_temper(section, &xyza->temper);
}

/* --- drives ----------------------------------------------------------------------------------- */

static bool find_bus(const struct sim_config *config, const char *name, size_t *index)
{
	for (*index = 0; name && *index < config->bus_count; (*index)++) {
		if (strcmp(config->buses[*index].name, name) == 0)
			return true;
	}
	return false;
}

static void read_drive(const struct sim_section *section, const struct sim_config *config,
                       struct sim_drive_config *drive)
{
	const char *name = sim_section_text(section, "bus");
	const struct sim_bus_config *bus;
	size_t ignored;

	drive->name = section->title;
	drive->latency = read_us(section, "own-latency-us");
	drive->deaf = read_us(section, "own-turnaround-us");
	if (find_bus(config, drive->name, &ignored))
		sim_section_refuse(section, NULL,
		                   "drive %s has the name of a bus; names must differ",
		                   drive->name);
	if (!find_bus(config, name, &drive->bus)) {
		sim_section_refuse(
			section, "bus",
			"drive %s: bus \"%s\" does not exist; name a bus section of this "
			"file",
			drive->name, name ? name : "");
		return;
	}
	drive->address = (unsigned)sim_section_whole(section, "address");
	bus = &config->buses[drive->bus];
	if (bus->kind == SIM_BUS_XYZA)
		read_xyza(section, &drive->xyza);
	else if (bus->kind == SIM_BUS_SERVO_CAN)
		read_servo(section, drive);
	else
		read_vsmd(section, bus, &drive->vsmd);
	read_faults(section, drive->faults, &drive->fault_count);
	/* Compared with the earlier drives of its bus. */
	for (const struct sim_drive_config *other = config->drives; other < drive; other++) {
		if (other->bus != drive->bus)
			continue;
		if (bus->kind == SIM_BUS_VSMD_SERIAL && !bus->serial.rs485) {
			sim_section_refuse(section, "bus",
			                   "drives %s and %s share the rs232 line %s; it can have "
			                   "only one",
			                   other->name, drive->name, bus->name);
			return;
		}
		if (other->address == drive->address && bus->serial.twins == SIM_TWINS_NONE) {
			sim_section_refuse(section, "address",
			                   "address %u is taken by drive %s on the same bus",
			                   drive->address, other->name);
			return;
		}
	}
}

/* --- the file --------------------------------------------------------------------------------- */

/* Each mistake is reported as an error. */
static void read_config(struct sim_config *config, struct db_messages *messages)
{
	static const struct db_reader_rules rules = {
		.sections = "bus NAME or drive NAME",
		.lenient = true,
	};
	const struct db_reader *reader = &config->reader;
	size_t buses = 0;
	struct sim_section section;

	if (!db_reader_read(&config->reader, &rules, messages))
		return;
	sim_section_check_all(reader, messages);
	if (messages->errors > 0)
		return;
	for (size_t i = 0; i < reader->section_count; i++)
		buses += strcmp(reader->sections[i].name, "bus") == 0;
	if (buses == 0 || buses == reader->section_count) {
		db_messages_add_error(messages, 0,
		                      "there must be at least one bus and one drive section");
		return;
	}
	config->buses = calloc(buses, sizeof(*config->buses));
	config->drives = calloc(reader->section_count - buses, sizeof(*config->drives));
	if (!config->buses || !config->drives) {
		db_messages_add_error(messages, 0, "out of memory; free some and try again");
		return;
	}
	for (size_t i = 0; i < reader->section_count; i++) {
		section = sim_section_open(reader, messages, i);
		if (strcmp(reader->sections[i].name, "bus") == 0)
			read_bus(&section, &config->buses[config->bus_count++]);
	}
	/* The drives' keys depend on their buses. */
	if (messages->errors > 0)
		return;
	for (size_t i = 0; i < reader->section_count; i++) {
		section = sim_section_open(reader, messages, i);
		if (strcmp(reader->sections[i].name, "drive") == 0)
			read_drive(&section, config, &config->drives[config->drive_count++]);
	}
}

int sim_config_parse(const char *text, const char *file, FILE *errors, struct sim_config *config)
{
	struct db_source *source = db_sources_of_text(file, text);
	struct db_messages messages = { .sources = source, .source_count = 1 };
	bool good;

	*config = (struct sim_config){ 0 };
	if (!source) {
		fprintf(errors, "%s: out of memory; free some and try again\n", file);
		return -1;
	}
	read_config(config, &messages);
	good = messages.errors == 0;
	db_messages_print(&messages, errors);
	db_messages_clear(&messages);
	db_sources_free(source, 1);
	if (good)
		return 0;
	sim_config_free(config);
	return -1;
}

int sim_config_load(const char *path, struct sim_config *config)
{
	char *text = db_file_read(path, stderr);
	int result = -1;

	*config = (struct sim_config){ 0 };
	if (text)
		result = sim_config_parse(text, path, stderr, config);
	free(text);
	return result;
}

void sim_config_free(struct sim_config *config)
{
	free(config->buses);
	free(config->drives);
	db_reader_clear(&config->reader);
	*config = (struct sim_config){ 0 };
}
