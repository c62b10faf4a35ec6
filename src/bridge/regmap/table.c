/* SPDX-License-Identifier: Apache-2.0 */
#include "regmap/table.h"

#include "regmap/image.h"
#include "regmap/rows.h"

const struct db_row_set *const db_row_sets[] = {
	&db_drive_registers, &db_drive_bits, &db_drive_coils, &db_gateway_registers, NULL,
};

const char db_velocity_unit[] = "counts/s";

#define AREA(of, in, from, to, title)                                                       \
	{                                                                                   \
		.name = (title), .view = (of), .table = (in), .first = (from), .last = (to) \
	}
#define HOLDING_AREA(of, from, to, title) AREA(of, DB_TABLE_HOLDING, from, to, title)
#define PARAM_AREA(page)                                                    \
	HOLDING_AREA(DB_VIEW_DRIVE, DB_PARAM_BASE + DB_PARAM_PAGE * (page), \
	             DB_PARAM_BASE + DB_PARAM_PAGE * ((page) + 1) - 1, "parameters")

const struct db_area db_areas[] = {
	HOLDING_AREA(DB_VIEW_DRIVE, 0, 99, "process data"),
	HOLDING_AREA(DB_VIEW_DRIVE, 100, 199, "command block"),
	PARAM_AREA(0),
	PARAM_AREA(1),
	PARAM_AREA(2),
	HOLDING_AREA(DB_VIEW_DRIVE, 3000, 3767, "history"),
	HOLDING_AREA(DB_VIEW_DRIVE, 4000, 4639, "addresses of the history"),
	HOLDING_AREA(DB_VIEW_DRIVE, 5000, 5511, "users of the history"),
	AREA(DB_VIEW_DRIVE, DB_TABLE_DISCRETE, 0, 95, "status bits"),
	HOLDING_AREA(DB_VIEW_GATEWAY, 60, 86, "groups"),
	HOLDING_AREA(DB_VIEW_GATEWAY, 2000, 2000 + DB_WINDOW_REGISTERS * DB_GATEWAY_WINDOWS - 1,
	             "window"),
};

const size_t db_area_count = COUNT_OF(db_areas);

/* Pages of parameters in db_areas. */
#define COMMON_PAGES 3

unsigned db_param_first(const struct db_driver *driver)
{
	unsigned page = driver->param_page;

	return page < DB_PARAM_LARGE ?
	               DB_PARAM_BASE + DB_PARAM_PAGE * page :
	               DB_PARAM_LARGE_BASE + DB_PARAM_LARGE_PAGE * (page - DB_PARAM_LARGE);
}

bool db_param_area(const struct db_driver *driver, struct db_area *area)
{
	unsigned first = db_param_first(driver);
	unsigned size = driver->param_page < DB_PARAM_LARGE ? DB_PARAM_PAGE : DB_PARAM_LARGE_PAGE;

	if (driver->param_page < COMMON_PAGES || driver->param_count == 0)
		return false;
	*area = (struct db_area)HOLDING_AREA(DB_VIEW_DRIVE, (uint16_t)first,
	                                     (uint16_t)(first + size - 1), "parameters");
	return true;
}
