/* SPDX-License-Identifier: Apache-2.0 */
/* Two signs make a restart of a VSMD drive, one a doubt, none nothing. */
#include "driver/vsmd/vsmd_private.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#define MS DB_NS_PER_MS
#define HS VSMD_ST_HS
#define STANDS (VSMD_ST_PWR | VSMD_ST_STP)
#define HOMED (STANDS | VSMD_ST_ZERO)
#define OFF VSMD_ST_STP

struct fixture {
	struct db_drive_config config;
	struct vsmd_axis axis;
	db_time now;
};

static void status(struct fixture *f, int32_t position, uint32_t word)
{
	const struct vsmd_status status = { .position = position, .status = word };

	f->now += 20 * MS;
	vsmd_take_status(&f->axis, &status, f->now);
	vsmd_follow_motion(&f->axis);
}

static void read_params(struct fixture *f, float speed, uint32_t pae)
{
	f->axis.plate.valid[0] = UINT64_C(1) << VSMD_SPD | UINT64_C(1) << VSMD_PAE;
	f->axis.plate.values[VSMD_SPD].f = speed;
	f->axis.plate.values[VSMD_PAE].u = pae;
	vsmd_take_all_params(&f->axis);
}

static void carry_out(struct fixture *f, enum db_command command)
{
	const struct db_args none = { 0 };
	const struct db_request request = { .command = command, .args = &none };

	vsmd_carry_out(&f->axis, &request);
}

/* A drive at `position` that was homed, or placed, there. */
static void make(struct fixture *f, int32_t position, uint32_t word)
{
	*f = (struct fixture){ .now = 1000 * MS };
	DB_NAMEPLATE_INIT(&f->axis.plate, &f->axis.plate_room, VSMD_PARAM_COUNT);

	f->axis.link = &vsmd_can_link;
	f->axis.config = &f->config;
	f->axis.reaction = 20 * MS;
	status(f, position, word & ~(uint32_t)VSMD_ST_ZERO);
	read_params(f, 6400.0f, 0);
	if (word & VSMD_ST_ZERO)
		status(f, position, word);
	else
		carry_out(f, DB_CMD_SET_POSITION);
}

static void silent(struct fixture *f)
{
	vsmd_axis_gone((struct db_device *)&f->axis);
	f->now += 2000 * MS;
}

static struct db_feedback seen(struct fixture *f)
{
	struct db_feedback feedback = { 0 };

	vsmd_write_feedback((const struct db_device *)&f->axis, &feedback);
	return feedback;
}

static bool is_lost(struct fixture *f)
{
	return seen(f).status & DB_STATUS_ORIGIN_LOST;
}

static bool is_homed(struct fixture *f)
{
	return seen(f).status & DB_STATUS_HOMED;
}

/* Nothing was told of it, and nothing of it is doubted. */
static void assert_nothing(struct fixture *f)
{
	assert_int_equal(seen(f).restarts, 0);
	assert_int_equal(seen(f).doubts, 0);
	assert_int_equal(seen(f).doubt, DB_DOUBT_NONE);
	assert_false(is_lost(f));
	assert_true(seen(f).status & DB_STATUS_PARAMS_VALID);
}

static void a_closed_loop_trembles_at_its_origin(void **state)
{
	static const uint32_t words[] = { HOMED, STANDS };

	(void)state;
	for (size_t i = 0; i < 2; i++) {
		struct fixture f;

		make(&f, 0, words[i]);
		for (int32_t count = 0; count < 50; count++)
			status(&f, count % 4 - 1, words[i]);
		for (int32_t count = 0; count < 50; count++)
			status(&f, count % 2 ? 16 : 0, words[i]);
		assert_nothing(&f);
		assert_true(is_homed(&f) == (words[i] == HOMED));
	}
}

/* `off` by itself makes 0 of the counter: the origin is lost, and the reason is the fault. */
static void a_stall_that_disables_is_no_restart(void **state)
{
	struct fixture f;

	make(&f, 0, HOMED | HS);
	(void)state;
	status(&f, 900, VSMD_ST_PWR | VSMD_ST_ZERO | HS);
	status(&f, 0, OFF | VSMD_ST_ZERO | HS | VSMD_ST_ENC_ERR);
	assert_int_equal(seen(&f).restarts, 0);
	assert_int_equal(seen(&f).doubts, 0);
	assert_true(is_lost(&f));
	assert_false(is_homed(&f));
	assert_int_equal(seen(&f).error, DB_ERROR_ENCODER);
}

static void silence_alone_is_none(void **state)
{
	struct fixture homed;
	struct fixture moving;
	struct fixture elsewhere;
	/* It would have lost its power: pae is 0. */
	struct fixture at_0;

	(void)state;
	make(&homed, 0, HOMED);
	make(&moving, 100, STANDS);
	make(&elsewhere, 5000, STANDS);
	make(&at_0, 0, STANDS);
	silent(&homed);
	status(&homed, 0, HOMED);
	status(&moving, 3000, VSMD_ST_PWR);
	silent(&moving);
	status(&moving, 9000, STANDS);
	silent(&elsewhere);
	status(&elsewhere, 5000, STANDS);
	silent(&at_0);
	status(&at_0, 0, STANDS);
	read_params(&homed, 6400.0f, 0);
	read_params(&moving, 6400.0f, 0);
	read_params(&elsewhere, 6400.0f, 0);
	read_params(&at_0, 6400.0f, 0);
	assert_nothing(&homed);
	assert_nothing(&moving);
	assert_nothing(&elsewhere);
	assert_nothing(&at_0);
}

/* Nothing in its status tells a drive that waited at 0 from one that began there. */
static void silence_at_0_is_a_doubt_until_something_tells(void **state)
{
	struct fixture f;

	make(&f, 0, STANDS);
	(void)state;
	read_params(&f, 6400.0f, 1);
	vsmd_memory_keep(&f.axis.memory, &f.axis.plate);
	for (unsigned i = 0; i < 4; i++) {
		silent(&f);
		status(&f, 0, STANDS);
		assert_int_equal(seen(&f).doubts, i + 1);
		assert_int_equal(seen(&f).doubt, DB_DOUBT_SILENT);
		assert_false(is_lost(&f));
		if (i == 0) { /* the same parameters prove nothing */
			read_params(&f, 6400.0f, 1);
			assert_int_equal(seen(&f).doubt, DB_DOUBT_SILENT);
			carry_out(&f, DB_CMD_SET_POSITION);
		} else if (i == 1) { /* unsaved ones would be lost */
			f.axis.memory.unsaved = true;
			read_params(&f, 6400.0f, 1);
		} else if (i == 2) { /* homed meanwhile */
			status(&f, 0, HOMED);
			status(&f, 0, STANDS | VSMD_ST_ZERO);
			status(&f, 5, VSMD_ST_PWR);
			status(&f, 0, STANDS);
			carry_out(&f, DB_CMD_SET_POSITION);
		} else { /* others are a second sign */
			read_params(&f, 100.0f, 1);
			assert_int_equal(seen(&f).restarts, 1);
			assert_true(is_lost(&f));
		}
		assert_int_equal(seen(&f).doubt, DB_DOUBT_NONE);
	}
}

static void two_signs_are_a_restart_at_once(void **state)
{
	static const struct {
		int32_t position;
		uint32_t before;
		bool silent;
		uint32_t word;
	} cases[] = {
		{ 5000, STANDS, false, OFF },         /* counter and power */
		{ 5000, STANDS | HS, false, STANDS }, /* counter and handshake */
		{ 0, HOMED, false, OFF },             /* homing and power */
		{ 0, STANDS | HS, false, OFF },       /* power and handshake, at 0 */
		{ 5000, VSMD_ST_PWR, false, OFF },    /* moving: counter and power */
		{ 5000, STANDS, true, STANDS },       /* silence and counter */
		{ 0, STANDS, true, OFF },             /* silence and power */
		{ 0, HOMED, true, STANDS },           /* silence and homing */
		{ 60000, VSMD_ST_PWR, true,
		  STANDS }, /* silence and the counter of one that moved */
	};

	(void)state;
	for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
		struct fixture f;

		make(&f, cases[i].position, cases[i].before | VSMD_ST_STP);
		status(&f, cases[i].position, cases[i].before);
		if (cases[i].silent)
			silent(&f);
		status(&f, 0, cases[i].word);
		assert_int_equal(seen(&f).restarts, 1);
		assert_int_equal(seen(&f).doubt, DB_DOUBT_NONE);
		assert_true(is_lost(&f));
		assert_false(is_homed(&f));
		assert_false(seen(&f).status & DB_STATUS_PARAMS_VALID);
	}
}

/* The origin is lost where the counter or the drive itself says so; that it restarted is not said. */
static void one_sign_is_a_doubt(void **state)
{
	static const struct {
		int32_t position;
		uint32_t before;
		uint32_t word;
		bool lost;
	} cases[] = {
		{ 5000, STANDS, STANDS, true }, /* with power nobody can push it */
		{ 5000, OFF, OFF, false },
		{ 0, STANDS, OFF, true }, /* as after disable */
		{ 0, HOMED, STANDS, true },
	};

	(void)state;
	for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
		struct fixture f;

		make(&f, cases[i].position, cases[i].before);
		status(&f, 0, cases[i].word);
		assert_int_equal(seen(&f).restarts, 0);
		assert_int_equal(seen(&f).doubts, 1);
		assert_int_equal(seen(&f).doubt, DB_DOUBT_SIGN);
		assert_true(is_lost(&f) == cases[i].lost);
		assert_true(seen(&f).status & DB_STATUS_PARAMS_VALID);
		assert_true(f.axis.plate.doubtful); /* to be read again */
		/* It goes on telling the same: that is no second sign. */
		status(&f, 0, cases[i].word);
		assert_int_equal(seen(&f).doubts, 1);
		read_params(&f, 100.0f, 0);
		assert_int_equal(seen(&f).restarts, 1);
		assert_true(is_lost(&f));
	}
}

static void one_wrong_answer_is_refuted_by_the_next(void **state)
{
	struct fixture f;

	make(&f, 5000, STANDS);
	(void)state;
	status(&f, 0, STANDS);
	assert_true(is_lost(&f));
	status(&f, 5000, STANDS);
	assert_false(is_lost(&f));
	assert_int_equal(seen(&f).doubt, DB_DOUBT_NONE);
	assert_int_equal(seen(&f).restarts, 0);
}

/* A drive that was told to home by something else begins to count at its origin: no restart. */
static void homing_by_itself_is_none(void **state)
{
	struct fixture f;

	(void)state;
	make(&f, 5000, STANDS);
	status(&f, 0, HOMED);
	assert_nothing(&f);
	assert_true(is_homed(&f));
}

static void a_handshake_lapses_without_a_restart(void **state)
{
	struct fixture f;
	struct fixture late;

	(void)state;
	make(&f, 0, STANDS | HS);
	make(&late, 0, STANDS | HS);
	for (unsigned i = 0; i < 5; i++) {
		status(&f, 0, STANDS);
		status(&f, 0, STANDS | HS);
	}
	assert_nothing(&f);
	read_params(&late, 6400.0f, 1); /* where power says nothing */
	status(&late, 0, STANDS);
	assert_int_equal(seen(&late).doubts, 1);
	assert_int_equal(seen(&late).restarts, 0);
}

/* Where it lapses, it counts only after it has stayed for a minute. */
static void a_handshake_that_stayed_for_long_counts(void **state)
{
	struct fixture f;

	(void)state;
	make(&f, 0, STANDS | HS);
	status(&f, 0, STANDS);
	status(&f, 0, STANDS | HS);
	read_params(&f, 6400.0f, 1); /* where power says nothing */
	for (unsigned i = 0; i < 59; i++) {
		f.now += 980 * MS;
		status(&f, 0, STANDS | HS);
	}
	status(&f, 0, STANDS);
	assert_int_equal(seen(&f).doubts, 0);
	status(&f, 0, STANDS | HS);
	for (unsigned i = 0; i < 61; i++) {
		f.now += 980 * MS;
		status(&f, 0, STANDS | HS);
	}
	status(&f, 0, STANDS);
	assert_int_equal(seen(&f).doubts, 1);
	assert_int_equal(seen(&f).restarts, 0);
}

/* What is written and not saved is lost with the power. */
static void settings_are_unsaved_until_they_are_saved(void **state)
{
	struct db_setting setting = { .param = VSMD_SPD, .value.f = 100.0f };
	const struct db_request request = { .settings = &setting, .setting_count = 1 };
	struct fixture f;

	(void)state;
	make(&f, 5000, STANDS);
	assert_false(seen(&f).status & DB_STATUS_PARAMS_UNSAVED);
	vsmd_take_settings(&f.axis, &request);
	assert_true(f.axis.plate.values[VSMD_SPD].f > 99.0f);
	assert_true(seen(&f).status & DB_STATUS_PARAMS_UNSAVED);
	assert_true(seen(&f).status & DB_STATUS_ENABLED);
	setting.value.f = 6400.0f;
	vsmd_take_settings(&f.axis, &request);
	assert_false(seen(&f).status & DB_STATUS_PARAMS_UNSAVED);
	status(&f, 5000, OFF);
	assert_false(seen(&f).status & DB_STATUS_ENABLED);
}

/* The text as the document has it, and as drives send it; it ends where no more of it can be shown. */
static void an_identity_is_text_without_quotation_marks(void **state)
{
	static const struct {
		const char *told;
		const char *kept;
	} cases[] = {
		{ "VSMD 106-025T", "VSMD 106-025T" },
		{ "\"VSMD\"", "VSMD" },
		{ "\"\"", "" },
		{ "\"AB", "\"AB" },
		{ "AB\"", "AB\"" },
		{ "\"", "\"" },
		{ "AB\rCD", "AB" },
	};
	char text[DB_IDENTITY_MAX + 8];

	(void)state;
	for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
		struct fixture f;
		uint32_t generation;

		make(&f, 0, STANDS);
		vsmd_take_identity(&f.axis, "before", 6);
		f.axis.memory.unsaved = true;
		generation = f.axis.plate.generation;
		vsmd_take_identity(&f.axis, "before", 6);
		assert_int_equal(f.axis.plate.generation, generation);
		assert_true(f.axis.memory.unsaved);
		/* Another drive. */
		vsmd_take_identity(&f.axis, cases[i].told, strlen(cases[i].told));
		assert_int_equal(f.axis.plate.generation, generation + 1);
		assert_string_equal(f.axis.plate.identity, cases[i].kept);
		assert_false(f.axis.memory.unsaved);
		memset(text, 'x', sizeof(text));
		vsmd_take_identity(&f.axis, text, sizeof(text));
		assert_memory_equal(f.axis.plate.identity, text, DB_IDENTITY_MAX);
		memcpy(text, "yyzz", 4);
		vsmd_take_identity(&f.axis, text, 2);
		assert_string_equal(f.axis.plate.identity, "yy");
	}
}

/* Homing that stands for longer than its pause has ended; what moves in between begins anew. */
static void homing_stands_for_its_pause(void **state)
{
	struct fixture f;

	(void)state;
	make(&f, 0, STANDS);
	f.axis.homing_pause = 100 * MS;
	for (unsigned round = 0; round < 3; round++) {
		if (round != 1)
			carry_out(&f, DB_CMD_HOME);
		else
			status(&f, 0, VSMD_ST_PWR);
		for (unsigned i = 0; i < 6; i++) {
			status(&f, 0, STANDS);
			assert_int_equal(seen(&f).state, DB_AXIS_HOMING);
		}
	}
	status(&f, 0, STANDS);
	assert_int_equal(seen(&f).state, DB_AXIS_STANDSTILL);
}

/* A homing bit that was set before is no end of the next homing. */
static void an_old_homing_bit_is_no_end_of_homing(void **state)
{
	(void)state;
	for (unsigned i = 0; i < 4; i++) {
		uint32_t old = i & 1 ? VSMD_ST_ZERO : 0;
		struct fixture f;

		make(&f, 5000, STANDS | old);
		if (i < 2)
			carry_out(&f, DB_CMD_DISABLE);
		else
			status(&f, 0, OFF | old); /* it has restarted */
		assert_true(is_lost(&f));
		carry_out(&f, DB_CMD_HOME);
		status(&f, 0, HOMED);
		assert_true(is_homed(&f) == !old);
		assert_true(is_lost(&f) == (old != 0));
		status(&f, 0, STANDS);
		status(&f, 0, HOMED);
		assert_true(is_homed(&f));
	}
}

/* What a command changes is no restart for half a second and the drive's reaction; after its effect
 * was seen everything is. */
static void a_change_is_expected_for_a_while(void **state)
{
	struct fixture f;

	(void)state;
	make(&f, 5000, STANDS);
	vsmd_expect_change(&f.axis);
	f.now += 490 * MS;
	status(&f, 5000, STANDS);
	status(&f, 0, OFF);
	assert_int_equal(seen(&f).restarts, 0);
	make(&f, 5000, STANDS);
	vsmd_expect_change(&f.axis);
	f.now += 510 * MS;
	status(&f, 5000, STANDS);
	status(&f, 0, OFF);
	assert_int_equal(seen(&f).restarts, 1);
	/* Homed, placed or disabled. */
	for (unsigned i = 0; i < 3; i++) {
		make(&f, 5000, STANDS);
		vsmd_expect_change(&f.axis);
		if (i == 0)
			status(&f, 5000, HOMED);
		else
			carry_out(&f, i == 1 ? DB_CMD_SET_POSITION : DB_CMD_DISABLE);
		status(&f, 0, OFF);
		assert_int_equal(seen(&f).restarts, 1);
	}
}

/* One who homes it, disables it, places it or says that it is right ends a doubt. */
static void a_doubt_ends_with_what_makes_it_certain(void **state)
{
	static const enum db_command commands[] = { DB_CMD_DISABLE, DB_CMD_SET_POSITION,
		                                    DB_CMD_CLEAR_FAULT };

	(void)state;
	for (size_t i = 0; i < 4; i++) {
		struct fixture f;

		make(&f, 5000, STANDS);
		status(&f, 0, STANDS);
		assert_int_equal(seen(&f).doubt, DB_DOUBT_SIGN);
		if (i < 3)
			carry_out(&f, commands[i]);
		else
			status(&f, 0, HOMED);
		assert_int_equal(seen(&f).doubt, DB_DOUBT_NONE);
		/* What is placed or homed has an origin; that it is right makes none of one that is lost. */
		assert_true(is_lost(&f) == (i == 0 || i == 2));
	}
}

/* What was refuted leaves it as it was: homed, and with an origin that silence makes doubtful. */
static void a_refuted_doubt_gives_back_what_was_known(void **state)
{
	static const uint32_t words[] = { STANDS, HOMED };
	struct fixture f;

	(void)state;
	for (size_t i = 0; i < 2; i++) {
		make(&f, 5000, words[i]);
		status(&f, 0, words[i]);
		assert_false(is_homed(&f));
		status(&f, 5000, words[i]);
		assert_true(is_homed(&f) == (words[i] == HOMED));
		assert_int_equal(seen(&f).doubts, 1);
		read_params(&f, 6400.0f, 1);
		assert_false(f.axis.plate.doubtful);
		silent(&f);
		status(&f, 9000, STANDS);
		assert_int_equal(seen(&f).doubts + seen(&f).restarts, 2);
	}
	/* One that was disabled since has no origin to be doubted. */
	make(&f, 5000, STANDS);
	carry_out(&f, DB_CMD_DISABLE);
	read_params(&f, 6400.0f, 1);
	silent(&f);
	status(&f, 9000, STANDS);
	assert_int_equal(seen(&f).doubts + seen(&f).restarts, 0);
}

/* One that was away and never had an origin has none to lose. */
static void what_never_had_an_origin_loses_none(void **state)
{
	static const struct {
		int32_t position;
		bool disabled;
		bool lost;
	} cases[] = { { 0, false, false }, { 5000, false, true }, { 0, true, true } };

	(void)state;
	for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
		struct fixture f;

		make(&f, 0, STANDS);
		f.axis.placed = false;
		if (cases[i].disabled)
			carry_out(&f, DB_CMD_DISABLE);
		status(&f, cases[i].position, VSMD_ST_PWR);
		status(&f, cases[i].position, STANDS);
		silent(&f);
		assert_false(seen(&f).status & DB_STATUS_PARAMS_VALID);
		status(&f, 0, OFF);
		assert_int_equal(seen(&f).restarts, 1);
		assert_true(is_lost(&f) == cases[i].lost);
	}
}

/* Homing, and a target, end with a restart; parameters that differ show one after a silence. */
static void nothing_goes_on_after_a_restart(void **state)
{
	const struct db_args args = { .target_position = 500 };
	const struct db_request move = { .command = DB_CMD_MOVE_ABSOLUTE, .args = &args };
	struct fixture f;

	(void)state;
	make(&f, 60000, STANDS);
	carry_out(&f, DB_CMD_HOME);
	status(&f, 60000, VSMD_ST_PWR);
	silent(&f);
	status(&f, 0, STANDS);
	assert_int_equal(seen(&f).restarts, 1);
	assert_int_equal(seen(&f).state, DB_AXIS_STANDSTILL);
	make(&f, 5000, STANDS);
	vsmd_carry_out(&f.axis, &move);
	status(&f, 5000, STANDS);
	assert_true(seen(&f).has_target);
	status(&f, 0, OFF);
	assert_int_equal(seen(&f).restarts, 1);
	assert_false(seen(&f).has_target);
	make(&f, 5000, STANDS);
	silent(&f);
	read_params(&f, 100.0f, 0);
	status(&f, 4000, STANDS);
	assert_int_equal(seen(&f).restarts, 1);
	/* They are known already, and count once. */
	status(&f, 4000, STANDS);
	silent(&f);
	status(&f, 4100, STANDS);
	assert_int_equal(seen(&f).restarts, 1);
	/* They differ while it is doubted: that is the second sign, and they are known. */
	make(&f, 5000, STANDS);
	status(&f, 0, STANDS);
	read_params(&f, 100.0f, 0);
	assert_int_equal(seen(&f).restarts, 1);
	assert_true(seen(&f).status & DB_STATUS_PARAMS_VALID);
	assert_false(f.axis.plate.doubtful);
}

/* Until the next status a command counts, and disable and stop end what was commanded before. */
static void a_command_counts_until_the_next_status(void **state)
{
	struct fixture f;

	(void)state;
	make(&f, 0, STANDS);
	carry_out(&f, DB_CMD_MOVE_PRESET);
	assert_true(seen(&f).status & DB_STATUS_MOVING);
	carry_out(&f, DB_CMD_STOP);
	assert_int_equal(seen(&f).state, DB_AXIS_STOPPING);
	assert_true(seen(&f).status & DB_STATUS_STOPPING);
	carry_out(&f, DB_CMD_MOVE_PRESET);
	assert_int_equal(seen(&f).state, DB_AXIS_CONTINUOUS_MOTION);
	carry_out(&f, DB_CMD_STOP);
	carry_out(&f, DB_CMD_DISABLE);
	assert_int_equal(seen(&f).state, DB_AXIS_STANDSTILL);
	assert_false(seen(&f).status & (DB_STATUS_MOVING | DB_STATUS_STOPPING));
	/* A stop of what stands stops nothing; one of what moves by itself does. */
	carry_out(&f, DB_CMD_STOP);
	assert_int_equal(seen(&f).state, DB_AXIS_STANDSTILL);
	vsmd_take_confirmation(&f.axis, 777, VSMD_ST_PWR, f.now);
	carry_out(&f, DB_CMD_STOP);
	assert_int_equal(seen(&f).state, DB_AXIS_STOPPING);
	/* A position that was set shows at once. */
	carry_out(&f, DB_CMD_SET_POSITION);
	assert_int_equal(seen(&f).position, 777);
	assert_false(is_lost(&f));
}

/* Six ports, and each only as far as its mode was read. */
static void a_port_is_what_its_mode_says(void **state)
{
	struct fixture f;

	(void)state;
	make(&f, 0, STANDS);
	status(&f, 0,
	       STANDS | VSMD_ST_S1 | VSMD_ST_S2 | VSMD_ST_S3 | VSMD_ST_S4 | VSMD_ST_S5 |
	               VSMD_ST_S6);
	for (unsigned output = 0; output < 2; output++) {
		for (unsigned i = 0; i < VSMD_PARAM_COUNT; i++)
			f.axis.plate.values[i].u = output;
		f.axis.plate.valid[0] = UINT64_MAX;
		assert_int_equal(vsmd_input_ports(&f.axis.plate), output ? 0 : 0x3F);
		assert_int_equal(seen(&f).outputs, output ? 0x3F : 0);
		assert_int_equal(seen(&f).inputs, 0x3F);
		f.axis.plate.valid[0] = 0;
		assert_int_equal(vsmd_input_ports(&f.axis.plate), 0);
		assert_int_equal(seen(&f).outputs, 0);
	}
}

/* A sensor may make its place the origin: then 0 all of a sudden is no sign. */
static void a_sensor_that_sets_the_origin_is_no_restart(void **state)
{
	(void)state;
	for (unsigned param = VSMD_S1F; param <= VSMD_S6R; param++) {
		for (uint32_t event = 0; event < 8; event++) {
			bool sets = event == 1 || event == 3 || event == 5;

			for (unsigned known = 0; known < 2; known++) {
				struct fixture f;

				make(&f, 5000, STANDS);
				f.axis.plate.values[param].u = event;
				f.axis.plate.valid[0] |= (uint64_t)known << param;
				status(&f, 0, STANDS);
				assert_int_equal(seen(&f).doubts, !(sets && known));
			}
		}
	}
}

/* One that homes by itself when it gets power is anywhere after that; others stand at 0. */
static void a_lost_homing_bit_is_a_sign_where_counters_begin(void **state)
{
	static const struct {
		int32_t position;
		uint32_t word;
		bool by_itself;
		bool any;
	} cases[] = {
		{ 0, STANDS, true, true },
		{ 0, VSMD_ST_PWR, true, false },
		{ 900, STANDS, true, false },
		{ 900, VSMD_ST_PWR, true, false },
	};

	(void)state;
	for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
		for (unsigned homes = 0; homes < 4; homes++) {
			struct fixture f;

			make(&f, 0, HOMED);
			f.axis.plate.values[VSMD_ZAR].u = homes & 1;
			f.axis.plate.valid[0] |= (uint64_t)(homes >> 1) << VSMD_ZAR;
			status(&f, cases[i].position, cases[i].word);
			assert_int_equal(seen(&f).doubts,
			                 homes == 3 ? cases[i].by_itself : cases[i].any);
		}
	}
}

/* A fault that is new, or an encoder's that stays, is the reason why the power went or the counter is 0. */
static void a_fault_is_no_restart(void **state)
{
	static const uint32_t faults[] = { VSMD_ST_FLT, VSMD_ST_ENC_ERR, VSMD_ST_OVER_CURRENT,
		                           VSMD_ST_OVER_TEMPERATURE, VSMD_ST_VOLTAGE };

	(void)state;
	for (size_t i = 0; i < sizeof(faults) / sizeof(faults[0]); i++) {
		for (unsigned had = 0; had < 2; had++) {
			bool reason = !had || faults[i] == VSMD_ST_ENC_ERR;
			uint32_t before = had ? faults[i] : 0;
			struct fixture f;

			make(&f, 0, STANDS | before); /* its power goes */
			status(&f, 0, OFF | faults[i]);
			assert_int_equal(seen(&f).doubts, !reason);
			assert_true(is_lost(&f));
			make(&f, 5000, STANDS | before); /* its counter is 0 */
			status(&f, 0, STANDS | faults[i]);
			assert_int_equal(seen(&f).doubts, !reason);
			assert_true(is_lost(&f));
			make(&f, 5000, STANDS | before); /* nothing of that */
			status(&f, 4000, STANDS | faults[i]);
			assert_int_equal(seen(&f).doubts + seen(&f).restarts, 0);
			assert_false(is_lost(&f));
		}
	}
}

/* What was told to move, or homes, may come to 0. */
static void one_that_was_told_to_move_may_stand_at_0(void **state)
{
	static const enum db_command commands[] = { DB_CMD_MOVE_PRESET, DB_CMD_HOME,
		                                    DB_CMD_SHAKE_START };
	struct fixture f;

	(void)state;
	for (size_t i = 0; i < sizeof(commands) / sizeof(commands[0]); i++) {
		make(&f, 5000, STANDS);
		carry_out(&f, commands[i]);
		status(&f, 0, STANDS);
		assert_nothing(&f);
	}
	for (unsigned i = 0; i < 2; i++) {
		make(&f, 5000, STANDS);
		f.axis.begun = i == 0 ? VSMD_MOTION_HOMING : VSMD_MOTION_SHAKE;
		status(&f, 0, STANDS);
		assert_nothing(&f);
	}
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(a_closed_loop_trembles_at_its_origin),
		cmocka_unit_test(a_stall_that_disables_is_no_restart),
		cmocka_unit_test(silence_alone_is_none),
		cmocka_unit_test(silence_at_0_is_a_doubt_until_something_tells),
		cmocka_unit_test(two_signs_are_a_restart_at_once),
		cmocka_unit_test(one_sign_is_a_doubt),
		cmocka_unit_test(one_wrong_answer_is_refuted_by_the_next),
		cmocka_unit_test(settings_are_unsaved_until_they_are_saved),
		cmocka_unit_test(homing_by_itself_is_none),
		cmocka_unit_test(a_handshake_lapses_without_a_restart),
		cmocka_unit_test(a_handshake_that_stayed_for_long_counts),
		cmocka_unit_test(an_identity_is_text_without_quotation_marks),
		cmocka_unit_test(homing_stands_for_its_pause),
		cmocka_unit_test(an_old_homing_bit_is_no_end_of_homing),
		cmocka_unit_test(a_change_is_expected_for_a_while),
		cmocka_unit_test(a_doubt_ends_with_what_makes_it_certain),
		cmocka_unit_test(a_refuted_doubt_gives_back_what_was_known),
		cmocka_unit_test(what_never_had_an_origin_loses_none),
		cmocka_unit_test(nothing_goes_on_after_a_restart),
		cmocka_unit_test(a_command_counts_until_the_next_status),
		cmocka_unit_test(a_port_is_what_its_mode_says),
		cmocka_unit_test(a_sensor_that_sets_the_origin_is_no_restart),
		cmocka_unit_test(a_lost_homing_bit_is_a_sign_where_counters_begin),
		cmocka_unit_test(a_fault_is_no_restart),
		cmocka_unit_test(one_that_was_told_to_move_may_stand_at_0),
	};

	return cmocka_run_group_tests_name("driver/vsmd_restart", tests, NULL, NULL);
}
