/* SPDX-License-Identifier: Apache-2.0 */
#include "transport/transport_private.h"

#include <linux/can/netlink.h>
#include <linux/if_link.h>
#include <linux/netlink.h>
#include <linux/rtnetlink.h>
#include <poll.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#define ANSWER_TIME 100   /* ms; the kernel answers at once, so this is for emergencies only */
#define ANSWER_SIZE 16384 /* a link message with statistics has about 2000 bytes */

#define ATTRIBUTE_HEAD sizeof(struct nlattr)

/* --- reading ---------------------------------------------------------------------------------- */

/* Attributes in a buffer that need not be aligned. */
struct attributes {
	const uint8_t *bytes;
	size_t length;
};

/* The content of the first attribute of this type; empty when there is none. */
static struct attributes find(struct attributes all, unsigned type)
{
	while (all.length >= ATTRIBUTE_HEAD) {
		struct nlattr head;
		size_t step;

		memcpy(&head, all.bytes, sizeof(head));
		if (head.nla_len < ATTRIBUTE_HEAD || head.nla_len > all.length)
			break;
		if ((head.nla_type & NLA_TYPE_MASK) == type)
			return (struct attributes){ all.bytes + ATTRIBUTE_HEAD,
				                    head.nla_len - ATTRIBUTE_HEAD };
		step = ((size_t)head.nla_len + NLA_ALIGNTO - 1) & ~((size_t)NLA_ALIGNTO - 1);
		if (step > all.length)
			break;
		all.bytes += step;
		all.length -= step;
	}
	return (struct attributes){ 0 };
}

bool db_can_link_parse(const void *message, size_t length, struct db_can_link *link)
{
	const size_t start = NLMSG_LENGTH(NLMSG_ALIGN(sizeof(struct ifinfomsg)));
	struct nlmsghdr head;
	struct attributes info;
	struct attributes kind;

	*link = (struct db_can_link){ 0 };
	if (length < sizeof(head))
		return false;
	memcpy(&head, message, sizeof(head));
	if (head.nlmsg_type != RTM_NEWLINK || head.nlmsg_len < start || head.nlmsg_len > length)
		return false;
	info = find((struct attributes){ (const uint8_t *)message + start, head.nlmsg_len - start },
	            IFLA_LINKINFO);
	kind = find(info, IFLA_INFO_KIND);
	/* With or without its terminating zero. */
	if (kind.length >= 3 && strncmp((const char *)kind.bytes, "can", kind.length) == 0) {
		struct attributes data = find(info, IFLA_INFO_DATA);
		struct attributes timing = find(data, IFLA_CAN_BITTIMING);
		struct attributes state = find(data, IFLA_CAN_STATE);
		struct can_bittiming bits;

		if (timing.length >= sizeof(bits)) {
			memcpy(&bits, timing.bytes, sizeof(bits));
			link->bitrate = bits.bitrate;
		}
		if (state.length >= sizeof(link->state)) {
			memcpy(&link->state, state.bytes, sizeof(link->state));
			link->has_state = true;
		}
	}
	return true;
}

/* --- asking ----------------------------------------------------------------------------------- */

struct question {
	struct nlmsghdr head;
	struct ifinfomsg link;
};

bool db_can_link_read(unsigned index, struct db_can_link *link)
{
	const struct sockaddr_nl kernel = { .nl_family = AF_NETLINK };
	const struct question question = {
		.head = { .nlmsg_len = sizeof(question),
		          .nlmsg_type = RTM_GETLINK,
		          .nlmsg_flags = NLM_F_REQUEST,
		          .nlmsg_seq = 1 },
		.link = { .ifi_family = AF_UNSPEC, .ifi_index = (int)index },
	};
	struct pollfd one = { .events = POLLIN };
	uint8_t answer[ANSWER_SIZE];
	bool known = false;

	*link = (struct db_can_link){ 0 };
	one.fd = socket(AF_NETLINK, SOCK_RAW | SOCK_CLOEXEC | SOCK_NONBLOCK, NETLINK_ROUTE);
	if (one.fd < 0)
		return false;
	if (sendto(one.fd, &question, sizeof(question), MSG_DONTWAIT,
	           (const struct sockaddr *)&kernel, sizeof(kernel)) == (ssize_t)sizeof(question) &&
	    poll(&one, 1, ANSWER_TIME) == 1) {
		ssize_t length = recv(one.fd, answer, sizeof(answer), MSG_DONTWAIT);

		known = length > 0 && db_can_link_parse(answer, (size_t)length, link);
	}
	close(one.fd);
	return known;
}
