/* SPDX-License-Identifier: Apache-2.0 */
/* A simulated VSMD drive is what its temperament says, at the times it says. */
#include "sim/vsmd_drive.h"
#include "sim/vsmd_mechanics.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#define MS DB_NS_PER_MS
#define AT_ONCE 1

struct bench {
	struct sim_vsmd_config config;
	struct sim_vsmd *drive;
	db_time now;
};

static struct bench make(struct sim_vsmd_temper temper)
{
	struct bench b = { .now = 1000 * DB_NS_PER_S };

	sim_vsmd_config_init(&b.config, 1, 9600);
	b.config.defaults[VSMD_PAE].u = 1;
	b.config.defaults[VSMD_S5].u = 1;
	b.config.temper = temper;
	b.drive = sim_vsmd_new(&b.config, b.now);
	assert_non_null(b.drive);
	return b;
}

static void say(struct bench *b, struct vsmd_command command)
{
	(void)sim_vsmd_execute(b->drive, &command, b->now);
}

static struct vsmd_status told(struct bench *b)
{
	struct vsmd_status status;

	sim_vsmd_report_status(b->drive, true, b->now, &status);
	return status;
}

static bool shows(struct bench *b, uint32_t bit)
{
	return told(b).status & bit;
}

static void the_documented_drive(void **state)
{
	struct bench b = make((struct sim_vsmd_temper){ 0 });

	(void)state;
	say(&b, (struct vsmd_command){ .verb = VSMD_STS });
	assert_false(shows(&b, VSMD_ST_HS));
	say(&b, (struct vsmd_command){ .verb = VSMD_DEV });
	assert_true(shows(&b, VSMD_ST_HS));
	say(&b, (struct vsmd_command){ .verb = VSMD_OFF });
	assert_false(shows(&b, VSMD_ST_PWR));
	sim_vsmd_power(b.drive, false, b.now);
	sim_vsmd_power(b.drive, true, b.now);
	assert_false(shows(&b, VSMD_ST_HS));
	free(b.drive);
}

static void handshakes(void **state)
{
	struct bench b = make((struct sim_vsmd_temper){ .handshake = SIM_HANDSHAKE_ANY,
	                                                .keeps_handshake = true,
	                                                .handshake_lapses = 500 * MS });

	(void)state;
	say(&b, (struct vsmd_command){ .verb = VSMD_STS });
	assert_true(shows(&b, VSMD_ST_HS));
	sim_vsmd_power(b.drive, false, b.now);
	sim_vsmd_power(b.drive, true, b.now);
	assert_true(shows(&b, VSMD_ST_HS));
	b.now += 500 * MS;
	assert_false(shows(&b, VSMD_ST_HS));
	free(b.drive);
}

static void late_bits_and_motions(void **state)
{
	struct bench b = make((struct sim_vsmd_temper){ .refusal = SIM_REFUSAL_KEPT,
	                                                .power_delay = 20 * MS,
	                                                .standing_delay = 30 * MS,
	                                                .motion_delay = 50 * MS });

	(void)state;
	say(&b, (struct vsmd_command){ .verb = VSMD_OFF });
	assert_true(shows(&b, VSMD_ST_PWR));
	b.now += 20 * MS;
	assert_false(shows(&b, VSMD_ST_PWR));
	say(&b, (struct vsmd_command){ .verb = VSMD_MOV });
	assert_true(shows(&b, VSMD_ST_CMD_WRG)); /* refused at once, not when it would begin */
	say(&b, (struct vsmd_command){ .verb = VSMD_ENA });
	say(&b, (struct vsmd_command){ .verb = VSMD_MOV });
	b.now += 49 * MS;
	assert_true(shows(&b, VSMD_ST_STP) && !sim_motion_moving(&b.drive->motion));
	b.now += 2 * MS;
	assert_true(shows(&b, VSMD_ST_STP)); /* it runs, and does not show it yet */
	assert_true(sim_motion_moving(&b.drive->motion));
	b.now += 30 * MS;
	assert_false(shows(&b, VSMD_ST_STP));
	say(&b, (struct vsmd_command){ .verb = VSMD_MOV, .has_velocity = true, .velocity = 1.0f });
	say(&b, (struct vsmd_command){ .verb = VSMD_STP, .has_value = true, .value = AT_ONCE });
	b.now += 200 * MS;
	assert_true(shows(&b, VSMD_ST_STP)); /* a stop takes back what has not begun */
	/* Nobody asks when it begins: it is no later for that. */
	say(&b, (struct vsmd_command){ .verb = VSMD_MOV, .has_velocity = true, .velocity = 1.0f });
	b.now += 81 * MS;
	assert_false(shows(&b, VSMD_ST_STP));
	free(b.drive);
}

static void refusals(void **state)
{
	const struct vsmd_command wrong = { .verb = VSMD_SENSOR_OUT, .port = 6, .value = 1 };
	struct bench kept = make((struct sim_vsmd_temper){ .refusal = SIM_REFUSAL_KEPT });
	struct bench once = make((struct sim_vsmd_temper){ .refusal = SIM_REFUSAL_ONCE });
	struct bench cleared = make((struct sim_vsmd_temper){ .refusal = SIM_REFUSAL_CLEARED });

	(void)state;
	say(&kept, wrong);
	say(&once, wrong);
	say(&cleared, wrong);
	assert_true(shows(&kept, VSMD_ST_CMD_WRG) && shows(&kept, VSMD_ST_CMD_WRG));
	say(&kept, (struct vsmd_command){ .verb = VSMD_STS });
	assert_true(shows(&kept, VSMD_ST_CMD_WRG));
	say(&kept, (struct vsmd_command){ .verb = VSMD_ENA });
	assert_false(shows(&kept, VSMD_ST_CMD_WRG));
	assert_true(shows(&once, VSMD_ST_CMD_WRG));
	assert_false(shows(&once, VSMD_ST_CMD_WRG));
	assert_false(shows(&cleared, VSMD_ST_CMD_WRG));
	free(kept.drive);
	free(once.drive);
	free(cleared.drive);
}

static void values_and_levels(void **state)
{
	struct vsmd_setting settings[] = { { VSMD_CRN, { .f = 9.0f } }, { VSMD_EZ, { .u = 7 } } };
	struct bench b = make(
		(struct sim_vsmd_temper){ .clamps = true, .rests_off = 1, .hides_outputs = true });
	uint32_t ez = b.drive->params[VSMD_EZ].u;

	(void)state;
	say(&b, (struct vsmd_command){
			.verb = VSMD_CFG_WRITE, .settings = settings, .setting_count = 2 });
	assert_false(shows(&b, VSMD_ST_CMD_WRG));
	assert_true(b.drive->params[VSMD_CRN].f > 2.4f && b.drive->params[VSMD_CRN].f < 2.6f);
	assert_int_equal(b.drive->params[VSMD_EZ].u, ez);
	say(&b, (struct vsmd_command){ .verb = VSMD_ORG, .has_value = true, .position = 10 });
	assert_int_equal(told(&b).position, 11);
	say(&b, (struct vsmd_command){ .verb = VSMD_SENSOR_OUT, .port = 5, .value = 1 });
	assert_false(shows(&b, VSMD_ST_CMD_WRG) || shows(&b, VSMD_ST_S5));
	free(b.drive);
}

static void registers(void **state)
{
	struct sim_vsmd_temper temper = { .lacks = { { 0x0b, 0x0b }, { 0x1c, 0x2b } },
		                          .lacks_count = 2 };
	struct sim_registers registers;

	(void)state;
	assert_true(sim_vsmd_has_registers(&temper, 0x08, 3));
	assert_false(sim_vsmd_has_registers(&temper, 0x08, 4));
	assert_true(sim_vsmd_has_registers(&temper, 0x0c, 16));
	assert_false(sim_vsmd_has_registers(&temper, 0x1a, 3));
	assert_false(sim_vsmd_has_registers(&temper, 0x20, 1));
	assert_true(sim_registers_parse("1c-2b", &registers));
	assert_true(registers.first == 0x1c && registers.last == 0x2b);
	assert_true(sim_registers_parse("0b", &registers));
	assert_true(registers.first == 0x0b && registers.last == 0x0b);
	assert_false(sim_registers_parse("2b-1c", &registers));
	assert_false(sim_registers_parse("x", &registers));
	assert_false(sim_registers_parse("1-", &registers));
	assert_false(sim_registers_parse("80", &registers));
}

static void dresses(const struct sim_vsmd_temper *temper, const char *text, const char *wanted,
                    size_t length)
{
	char out[64];

	assert_int_equal(sim_vsmd_dress_text(temper, text, strlen(text), out, sizeof out), length);
	assert_memory_equal(out, wanted, length);
}

static void texts(void **state)
{
	char small[8];

	(void)state;
	dresses(&(struct sim_vsmd_temper){ 0 }, "A-1.0", "A-1.0", 5);
	dresses(&(struct sim_vsmd_temper){ .text = SIM_TEXT_NUL }, "A", "A", 2);
	dresses(&(struct sim_vsmd_temper){ .text = SIM_TEXT_CRLF }, "A", "A\r\n", 3);
	dresses(&(struct sim_vsmd_temper){ .text = SIM_TEXT_QUOTED, .numbers = SIM_NUMBERS_QUOTED },
	        "a=1 b=2", "\"a=\"1\" b=\"2\"\"", 13);
	dresses(&(struct sim_vsmd_temper){ .numbers = SIM_NUMBERS_EXPONENT }, "a=-800.5 b=2",
	        "a=-8.005000000e+02 b=2.000000000e+00", 36);
	assert_int_equal(sim_vsmd_dress_text(&(struct sim_vsmd_temper){ .text = SIM_TEXT_NUL },
	                                     "12345678", 8, small, sizeof small),
	                 -1);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(the_documented_drive),
		cmocka_unit_test(handshakes),
		cmocka_unit_test(late_bits_and_motions),
		cmocka_unit_test(refusals),
		cmocka_unit_test(values_and_levels),
		cmocka_unit_test(registers),
		cmocka_unit_test(texts),
	};

	return cmocka_run_group_tests_name("sim/vsmd_temper", tests, NULL, NULL);
}
